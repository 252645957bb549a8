"""Every public name: those at the top, and those of the modules listed there."""

import dataclasses
import inspect

import steadyslip as ss
from steadyslip.core.records import FrozenRecord


def public():
    """Public things by dotted name, each once, without modules."""
    top = {name: getattr(ss, name) for name in ss.__all__}
    modules = {name: thing for name, thing in top.items() if inspect.ismodule(thing)}
    found = {name: thing for name, thing in top.items() if name not in modules}
    for part, module in modules.items():
        names = (name for name in getattr(module, "__all__", ()) if name not in found)
        found |= {f"{part}.{name}": getattr(module, name) for name in names}
    return found


def public_results():
    """Types that functions give back; not errors, records of parameters, and what laws and their tests take."""
    taken = "laws.", "testing."
    classes = [one for name, one in public().items() if inspect.isclass(one) and not name.startswith(taken)]
    shown = [one for one in classes if dataclasses.is_dataclass(one) or hasattr(one, "_repr_html_")]
    return [one for one in shown if not issubclass(one, (Exception, FrozenRecord))]
