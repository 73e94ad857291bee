"""The two estimators of objects' influence on real surfaces, with equal settings."""

from __future__ import annotations

from typing import Any

from iprt.settings.model import Settings
from iprt.settings.trace import TraceSettings

ESTIMATORS = ("delta", "ratio")


def variant(estimator: str, *, objects: str = "triangles", **others: Any) -> Settings:
    """Settings of `iprt`, or of `iprt2023` with the rays and the filter of `iprt`.

    `objects` is what rays meet with the estimator "ratio"; with "delta" it is always triangles.
    """
    if estimator == "delta":
        return Settings.model_validate(others)
    trace = TraceSettings().model_dump() | others.pop("trace", {})
    own = {"objects": objects, "filter": "fast-slow"}
    return Settings.model_validate(
        {"method": "iprt2023", "iprt2023": own, "trace": trace, **others}
    )


def as_traced(method: str, **others: Any) -> Settings:
    """Return settings without filters: what remains is noise, which averages out."""
    raw: dict[str, Any] = {"fading": 0.0, "atrous": {"levels": 0}, "mask": {"sparse": False}}
    return Settings.model_validate({"method": method, **raw, **others})
