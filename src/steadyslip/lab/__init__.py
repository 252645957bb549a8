"""Records of experiments: read them, fit rigs to them, say how sure that is and what follows for another rig."""

from steadyslip.lab.fit import fit
from steadyslip.lab.laws import LawComparison, compare, compare_laws
from steadyslip.lab.precision import Precision, best_protocol, precision
from steadyslip.lab.predict import Prediction, predict
from steadyslip.lab.read import read_record, record_from_arrays
from steadyslip.lab.record import Record
from steadyslip.lab.result import Estimate, Fit
from steadyslip.lab.spec import Spec, fit_files, lab_rig, read_spec
from steadyslip.lab.store import load_fit
from steadyslip.lab.uncertainty import Draws, Profile, bootstrap, normal_draws, posterior, profile

__all__ = [
    "Draws",
    "Estimate",
    "Fit",
    "LawComparison",
    "Precision",
    "Prediction",
    "Profile",
    "Record",
    "Spec",
    "best_protocol",
    "bootstrap",
    "compare",
    "compare_laws",
    "fit",
    "fit_files",
    "lab_rig",
    "load_fit",
    "normal_draws",
    "posterior",
    "precision",
    "predict",
    "profile",
    "read_record",
    "read_spec",
    "record_from_arrays",
]
