"""What a computation returns, and how it is written, drawn and read: plain arrays, no dolfinx."""

from rotfem.results.campbell import CampbellResult, CriticalSpeed, Instability
from rotfem.results.modes import ModesResult, ResponseResult
from rotfem.results.of_scene import CheckResult, ExplainResult
from rotfem.results.result import Result
from rotfem.results.run import RunResult

__all__ = [
    "CampbellResult",
    "CheckResult",
    "CriticalSpeed",
    "ExplainResult",
    "Instability",
    "ModesResult",
    "ResponseResult",
    "Result",
    "RunResult",
]
