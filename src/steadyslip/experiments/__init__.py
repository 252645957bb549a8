"""Records of experiments: read them, fit rigs to them, say how sure that is and what follows for another rig.

Knows no verdicts, maps or figures: fits come back as numbers and records.
"""

from steadyslip.experiments.answers.laws import LawComparison, compare, compare_laws
from steadyslip.experiments.answers.population import Population, population
from steadyslip.experiments.answers.precision import Precision, best_protocol, precision
from steadyslip.experiments.answers.predict import Prediction, predict
from steadyslip.experiments.answers.profiles import Profile, profile
from steadyslip.experiments.answers.uncertainty import Draws, bootstrap, normal_draws, posterior
from steadyslip.experiments.answers.validation import CrossValidation, cross_validate
from steadyslip.experiments.fitting.fit import fit
from steadyslip.experiments.fitting.numbers import Estimate
from steadyslip.experiments.fitting.result import Fit, load_fit
from steadyslip.experiments.from_files import fit_files, population_files
from steadyslip.experiments.measured.read import read_record, record_from_arrays
from steadyslip.experiments.measured.record import Record
from steadyslip.experiments.spec import Spec, lab_rig, read_spec

__all__ = [
    "CrossValidation",
    "Draws",
    "Estimate",
    "Fit",
    "LawComparison",
    "Population",
    "Precision",
    "Prediction",
    "Profile",
    "Record",
    "Spec",
    "best_protocol",
    "bootstrap",
    "compare",
    "compare_laws",
    "cross_validate",
    "fit",
    "fit_files",
    "lab_rig",
    "load_fit",
    "normal_draws",
    "population",
    "population_files",
    "posterior",
    "precision",
    "predict",
    "profile",
    "read_record",
    "read_spec",
    "record_from_arrays",
]
