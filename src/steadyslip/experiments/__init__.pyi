"""Records of experiments: read them, fit rigs to them, say how sure that is and what follows for another rig.

Knows no verdicts, maps or figures: fits come back as numbers and records.
"""

from .answers.laws import LawComparison, compare, compare_laws
from .answers.population import Population, load_population, population
from .answers.precision import Precision, best_protocol, precision
from .answers.predict import Prediction, predict
from .answers.profiles import Profile, profile
from .answers.step_table import StepTable, step_table
from .answers.uncertainty import Draws, bootstrap, load_draws, normal_draws, posterior
from .answers.validation import CrossValidation, cross_validate
from .fitting.estimates import Estimate
from .fitting.fit import fit
from .fitting.machines.machine_result import MachineFit
from .fitting.result import Fit, load_fit
from .from_files import fit_files, population_files
from .from_speeds import fit_friction_table
from .measured.motion_record import MotionRecord, motion_from_arrays, read_frequency_response, read_motion
from .measured.read import read_record, record_from_arrays
from .measured.record import Record
from .spec import Spec, lab_rig, read_spec

__all__ = [
    "CrossValidation",
    "Draws",
    "Estimate",
    "Fit",
    "LawComparison",
    "MachineFit",
    "MotionRecord",
    "Population",
    "Precision",
    "Prediction",
    "Profile",
    "Record",
    "Spec",
    "StepTable",
    "best_protocol",
    "bootstrap",
    "compare",
    "compare_laws",
    "cross_validate",
    "fit",
    "fit_files",
    "fit_friction_table",
    "lab_rig",
    "load_draws",
    "load_fit",
    "load_population",
    "motion_from_arrays",
    "normal_draws",
    "population",
    "population_files",
    "posterior",
    "precision",
    "predict",
    "profile",
    "read_frequency_response",
    "read_motion",
    "read_record",
    "read_spec",
    "record_from_arrays",
    "step_table",
]
