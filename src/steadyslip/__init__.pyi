# The public names: read by type checkers, and by __init__.py, which loads them on first use.

from . import figures as figures, testing as testing, units as units
from .core.errors import (
    IllPosedWarning as IllPosedWarning,
    NoSteadySliding as NoSteadySliding,
    NotAvailable as NotAvailable,
    NotKeptWarning as NotKeptWarning,
    OutOfRangeWarning as OutOfRangeWarning,
    ParameterError as ParameterError,
    QuantityError as QuantityError,
    RigFileError as RigFileError,
    SteadyslipError as SteadyslipError,
    UnknownNameError as UnknownNameError,
)
from .core.records import (
    option as option,
    parameter as parameter,
    part as part,
    parts as parts,
    samples as samples,
)
from .experiments import (
    CrossValidation as CrossValidation,
    Draws as Draws,
    Estimate as Estimate,
    Fit as Fit,
    LawComparison as LawComparison,
    Population as Population,
    Precision as Precision,
    Prediction as Prediction,
    Profile as Profile,
    Record as Record,
    Spec as Spec,
    best_protocol as best_protocol,
    bootstrap as bootstrap,
    compare as compare,
    compare_laws as compare_laws,
    cross_validate as cross_validate,
    fit as fit,
    fit_files as fit_files,
    lab_rig as lab_rig,
    load_draws as load_draws,
    load_fit as load_fit,
    load_population as load_population,
    normal_draws as normal_draws,
    population as population,
    population_files as population_files,
    posterior as posterior,
    precision as precision,
    predict as predict,
    profile as profile,
    read_record as read_record,
    read_spec as read_spec,
    record_from_arrays as record_from_arrays,
)
from .explorer import (
    Explorer as Explorer,
    explore as explore,
)
from .files.specifications import (
    piece_from_text as piece_from_text,
    protocol_from_text as protocol_from_text,
    read_protocol as read_protocol,
    read_rig as read_rig,
    rig_from_text as rig_from_text,
    rig_to_text as rig_to_text,
    write_rig as write_rig,
)
from .laws.contact import (
    Compliant as Compliant,
    Constant as Constant,
    ContactLaw as ContactLaw,
    DilatingLayer as DilatingLayer,
    InclinedSpring as InclinedSpring,
    LeadScrew as LeadScrew,
    Lift as Lift,
    Linear as Linear,
    Motion as Motion,
    PoreFluid as PoreFluid,
    PreloadedContact as PreloadedContact,
    Prescribed as Prescribed,
    SelfEnergising as SelfEnergising,
    SliderCrank as SliderCrank,
    SlopedGuide as SlopedGuide,
    Triaxial as Triaxial,
)
from .laws.friction import (
    PRZ as PRZ,
    Aging as Aging,
    CoulombStribeck as CoulombStribeck,
    Evolution as Evolution,
    FrictionLaw as FrictionLaw,
    LinkerDieterich as LinkerDieterich,
    LuGre as LuGre,
    Nagata as Nagata,
    NoMemory as NoMemory,
    NormalMemory as NormalMemory,
    PrakashClifton as PrakashClifton,
    RateState as RateState,
    Slip as Slip,
    State as State,
)
from .linear import (
    Boundary as Boundary,
    Margin as Margin,
    Mode as Mode,
    Response as Response,
    boundary as boundary,
    critical_stiffness as critical_stiffness,
    eigenvalues as eigenvalues,
    formula as formula,
    growth_rate as growth_rate,
    margins as margins,
    modes as modes,
    paper as paper,
    safety_factor as safety_factor,
    small_signal as small_signal,
    stability as stability,
    stable_stiffness as stable_stiffness,
    stable_values as stable_values,
    state_space as state_space,
    to_control as to_control,
)
from .machine.bodies import (
    Body as Body,
    PlanarBody as PlanarBody,
    RotatingBody as RotatingBody,
    SlidingBody as SlidingBody,
)
from .machine.drive import (
    PD as PD,
    PID as PID,
    Drive as Drive,
    Steady as Steady,
)
from .machine.joining import (
    joined as joined,
)
from .machine.links import (
    Link as Link,
    Screw as Screw,
    Shaft as Shaft,
    Spring as Spring,
)
from .machine.machine import (
    Machine as Machine,
)
from .machine.servo import (
    Cascade as Cascade,
    MachineDrive as MachineDrive,
    PositionPD as PositionPD,
    PositionPID as PositionPID,
    Pull as Pull,
    RotaryCascade as RotaryCascade,
    RotaryPD as RotaryPD,
    RotaryPID as RotaryPID,
    RotaryPull as RotaryPull,
)
from .machine.slider import (
    Slider as Slider,
)
from .machine.surfaces import (
    Surface as Surface,
)
from .maps import (
    Edge as Edge,
    Events as Events,
    Grid as Grid,
    KickThreshold as KickThreshold,
    LogMargin as LogMargin,
    Map as Map,
    MapResult as MapResult,
    Measure as Measure,
    OnsetKind as OnsetKind,
    Refined as Refined,
    SafetyFactor as SafetyFactor,
    Samples as Samples,
    Sensitivity as Sensitivity,
    StableValues as StableValues,
    map_from_text as map_from_text,
    measure as measure,
    open_map as open_map,
    read_map as read_map,
    refine as refine,
    run_map as run_map,
    sensitivity as sensitivity,
)
from .model import (
    Model as Model,
    build_model as build_model,
)
from .model.sliding import (
    SteadyContact as SteadyContact,
    SteadyMachine as SteadyMachine,
    SteadySliding as SteadySliding,
    steady_state as steady_state,
    steady_states as steady_states,
)
from .motion import (
    ContactEvent as ContactEvent,
    ContactSlip as ContactSlip,
    Ensemble as Ensemble,
    Event as Event,
    History as History,
    SlipEvent as SlipEvent,
    load_history as load_history,
    simulate as simulate,
    simulate_many as simulate_many,
)
from .nonlinear import (
    Basin as Basin,
    Cycle as Cycle,
    CycleBranch as CycleBranch,
    FrequencyResponse as FrequencyResponse,
    FrozenVerdicts as FrozenVerdicts,
    HopfCurve as HopfCurve,
    KickMargin as KickMargin,
    Onset as Onset,
    SpecialCycle as SpecialCycle,
    SpecialPoint as SpecialPoint,
    Threshold as Threshold,
    basin as basin,
    cycles as cycles,
    frozen_verdicts as frozen_verdicts,
    hopf as hopf,
    hopf_curve as hopf_curve,
    margin_to_kick as margin_to_kick,
    orbit as orbit,
    response as response,
    threshold as threshold,
    threshold_map as threshold_map,
)
from .protocol import (
    Creep as Creep,
    CreepRamp as CreepRamp,
    CreepStep as CreepStep,
    CreepTable as CreepTable,
    DisplacementStep as DisplacementStep,
    DisturbanceHarmonic as DisturbanceHarmonic,
    DisturbancePulse as DisturbancePulse,
    DisturbanceRamp as DisturbanceRamp,
    DisturbanceStep as DisturbanceStep,
    DisturbanceTable as DisturbanceTable,
    Hold as Hold,
    InjectionHarmonic as InjectionHarmonic,
    InjectionPulse as InjectionPulse,
    InjectionRamp as InjectionRamp,
    InjectionStep as InjectionStep,
    InjectionTable as InjectionTable,
    LoadPointTable as LoadPointTable,
    NormalStressHarmonic as NormalStressHarmonic,
    NormalStressPulse as NormalStressPulse,
    NormalStressRamp as NormalStressRamp,
    NormalStressStep as NormalStressStep,
    NormalStressTable as NormalStressTable,
    Piece as Piece,
    Protocol as Protocol,
    SlideHoldSlide as SlideHoldSlide,
    VelocityHarmonic as VelocityHarmonic,
    VelocityRamp as VelocityRamp,
    VelocityStep as VelocityStep,
)
from .reports import (
    Report as Report,
    report as report,
)
from .schemas import json_schema as json_schema
from .verdict import (
    Analysis as Analysis,
    MachineAnalysis as MachineAnalysis,
    Tolerated as Tolerated,
    analyze as analyze,
    tolerate as tolerate,
)

__version__: str
__all__: list[str]
