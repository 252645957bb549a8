# The names at the top: read by type checkers, and by __init__.py, which loads them on first use. What rigs, protocols,
# fits and maps are made of, and the types of results, are in the modules named first.

from . import (
    experiments as experiments,
    explorer as explorer,
    figures as figures,
    laws as laws,
    linear as linear,
    machine as machine,
    maps as maps,
    model as model,
    motion as motion,
    nonlinear as nonlinear,
    protocol as protocol,
    reports as reports,
    testing as testing,
    units as units,
    verdict as verdict,
)
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
from .experiments import (
    compare_laws as compare_laws,
    fit as fit,
    fit_files as fit_files,
    lab_rig as lab_rig,
    load_fit as load_fit,
    population as population,
    predict as predict,
    read_record as read_record,
    record_from_arrays as record_from_arrays,
)
from .explorer import (
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
from .linear import (
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
)
from .machine.machine import (
    Machine as Machine,
)
from .machine.slider import (
    Slider as Slider,
)
from .maps import (
    Map as Map,
    map_from_text as map_from_text,
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
    steady_state as steady_state,
    steady_states as steady_states,
)
from .motion import (
    load_history as load_history,
    simulate as simulate,
    simulate_many as simulate_many,
)
from .nonlinear import (
    basin as basin,
    cycles as cycles,
    frozen_verdicts as frozen_verdicts,
    hopf as hopf,
    hopf_curve as hopf_curve,
    hunt as hunt,
    margin_to_kick as margin_to_kick,
    orbit as orbit,
    response as response,
    threshold as threshold,
    threshold_map as threshold_map,
)
from .protocol import (
    Protocol as Protocol,
)
from .reports import (
    report as report,
)
from .schemas import (
    json_schema as json_schema,
)
from .verdict import (
    analyze as analyze,
    compare_rigs as compare_rigs,
    cure as cure,
    tolerate as tolerate,
)

__version__: str
__all__: list[str]
