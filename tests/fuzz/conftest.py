"""Always the same examples; nothing is collected where hypothesis, which only tests need, is not installed."""

from __future__ import annotations

from importlib.util import find_spec

collect_ignore_glob = [] if find_spec("hypothesis") else ["test_*.py"]
if not collect_ignore_glob:
    from hypothesis import HealthCheck, Phase, settings

    settings.register_profile(
        "fuzz",
        derandomize=True,
        database=None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
        phases=(Phase.generate,),  # to make a whole computation smaller takes long
    )
    settings.load_profile("fuzz")
