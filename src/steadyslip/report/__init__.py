"""Results as pages that anybody can open: HTML in one file, figures inside."""

from steadyslip.report.fit import fit_report

__all__ = ["fit_report"]
