"""Public functions answer odd settings in words of ours."""

import inspect
import warnings
from typing import Any

import pytest
from array_calls import CALLS, T, X
from odd_values import ODD, RUN

from seakeep import core, metrics, signals, statistics, waves
from seakeep.checked import checked
from seakeep.errors import SeakeepError

ROOMS = {"core": core, "signals": signals, "statistics": statistics, "metrics": metrics,
         "waves": waves}  # fmt: skip
PUBLIC = {
    f"{room}.{name}": getattr(module, name)
    for room, module in ROOMS.items()
    for name in module.__all__
    if inspect.isfunction(getattr(module, name))
}
OTHERS: dict[str, tuple[Any, ...]] = {
    "core.training_window": (900, None, 2, 3, "before"),
    "metrics.anrmse_differences": ([[RUN, RUN]], [RUN, RUN]),
    "metrics.labelled": (metrics.nrmse, "channel"),
    "signals.froude_factor": ("N", 20.0),
    "signals.lowpass_taps": (20.0, 2.0, 3.0),
    "signals.pool_drift": ([signals.clock_from_shared(X, T, X, T)] * 2,),
    "statistics.overlap_block": ([("a", 0.0, 9.0), ("a", 5.0, 14.0)],),
}
"""Sound arguments of functions that take no arrays."""
FILES = {"signals.contact_sheet", "signals.track_video"}
"""Those of a video; `tests/signals/test_tracking.py` has one."""


def sound(name: str, monkeypatch: pytest.MonkeyPatch) -> inspect.BoundArguments:
    """Arguments of a call that passes, defaults among them."""
    function, found = PUBLIC[name], []
    if name in OTHERS:
        found.append(inspect.signature(function).bind(*OTHERS[name]))
    else:
        room, attribute = name.split(".")

        def record(*args: Any, **kwargs: Any) -> Any:
            found.append(inspect.signature(function).bind(*args, **kwargs))
            return function(*args, **kwargs)

        call, *given = CALLS[name]
        with monkeypatch.context() as patch:
            patch.setattr(ROOMS[room], attribute, record)
            if call is function:
                record(*given)
            elif room == "metrics":
                record(predicted=given[0], measured=given[1])
            else:
                call(*given)
    found[-1].apply_defaults()
    return found[-1]


@pytest.mark.parametrize("name", sorted(set(PUBLIC) - FILES))
def test_an_odd_argument_is_taken_or_named(name, monkeypatch):
    """No error of Python or NumPy reaches the user."""
    call, fell = sound(name, monkeypatch), {}
    for parameter, usual in dict(call.arguments).items():
        if parameter in ("statistic", "measure"):
            continue  # functions of the user's own, with errors of their own
        many = call.signature.parameters[parameter].kind is inspect.Parameter.VAR_POSITIONAL
        for kind, value in ODD.items():
            call.arguments[parameter] = (value,) if many else value
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                try:
                    called = PUBLIC[name](*call.args, **call.kwargs)
                    if name == "metrics.labelled":
                        called(predicted=RUN, measured=RUN)
                except SeakeepError:
                    pass
                except Exception as error:
                    fell[f"{parameter} = {kind}"] = repr(error)[:100]
        call.arguments[parameter] = usual
    assert fell == {}


@pytest.mark.parametrize("name", PUBLIC)
def test_every_public_function_is_checked(name):
    layers, code = [PUBLIC[name]], checked(lambda: None).__code__  # type: ignore[attr-defined]
    while inner := getattr(layers[-1], "__wrapped__", None):
        layers.append(inner)
    assert any(each.__code__ is code for each in layers)
