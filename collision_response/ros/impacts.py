"""The service for one impact."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from typing import Any

from ..msg import BodyState, CollisionResult
from ..recording import Record, Recorder, Refusal
from ..requirements import SceneSurvey
from ..resolve import resolve
from ..srv import ResolveCollision
from ..status import ImpactError, StatusCode
from . import convert
from .parameters import LatestParameters
from .patience import when_not_too_early
from .request import complete
from .results import Results
from .serialized import nanoseconds
from .server import Answer
from .states import LatestStates


class Impacts:
    """Answers requests; publishes and records the answers, refusals included.

    Attributes:
        recorder: may be set; ``None``: nothing is recorded.
        survey: may be set, to log what the scene requires.

    Args:
        parameters: of the node.
        states: of the bodies that it has heard of.
        results: where answers are published.
        now: the time by the node's clock [ns].
        sequence: counts the answers of the node.
        logger: of the node.
    """

    interface = ResolveCollision
    name = "~/resolve_collision"

    def __init__(
        self,
        parameters: LatestParameters,
        states: LatestStates,
        results: Results,
        now: Callable[[], int],
        sequence: Iterator[int],
        logger: Any,
    ) -> None:
        self.recorder: Recorder | None = None
        self.survey: SceneSurvey | None = None
        self._parameters = parameters
        self._states = states
        self._results = results
        self._now = now
        self._log = logger
        self._numbers = sequence
        self._sequence = 0
        self._warned: set[str] = set()

    def answer(self, request: ResolveCollision.Request) -> Answer:
        """The work for a request."""
        current = self._parameters.values
        used = yield from when_not_too_early(
            partial(complete, request, self._states, current, self._now), current.max_state_wait
        )
        self._warn_of_coefficients(request)
        scene = convert.scene_of(request, current)
        impact = resolve(*scene)
        response = ResolveCollision.Response(success=True)
        result = response.result
        convert.write_answer(result, request, impact)
        result.state_stamp_a, result.state_stamp_b = (state.stamp for state in used)
        result.state_age_a, result.state_age_b = (state.age for state in used)
        self._publish(result)
        names = result.contact.body_a or "body_a", result.contact.body_b or "body_b"
        if self.survey is not None:
            self._log_requirements(self.survey, " - ".join(names), scene)
        if self.recorder is not None:
            record = Record(
                stamp_of(result, self._now), self._sequence, *names, scene.body_a, scene.body_b, impact
            )
            self.recorder.add(record)
        return response

    def refusal(self, request: ResolveCollision.Request, error: ImpactError) -> ResolveCollision.Response:
        """The response that says why there is no answer."""
        response = ResolveCollision.Response()
        message = convert.as_in_message(error)
        convert.write_refusal(response.result, request, error.code, message)
        self._publish(response.result)
        if self.recorder is not None:
            text = f"{error.code.name}: {message}"
            self.recorder.add(Refusal(stamp_of(response.result, self._now), self._sequence, text))
        return response

    def code(self, response: ResolveCollision.Response) -> StatusCode:
        """How the request ended."""
        return StatusCode(response.result.status.code)

    def _publish(self, result: CollisionResult) -> None:
        self._sequence = next(self._numbers)
        result.sequence = self._sequence
        self._results.publish(result)

    def _warn_of_coefficients(self, request: ResolveCollision.Request) -> None:
        for field in ("restitution", "friction"):
            if field not in self._warned and convert.only_one_body_says(field, request):
                self._warned.add(field)
                self._log.warning(
                    f"only one of two bodies has a coefficient of {field}: the parameter {field} is used; "
                    "this is said once"
                )

    def _log_requirements(self, survey: SceneSurvey, name: str, scene: convert.Scene) -> None:
        before = survey.requirements()
        with suppress(ImpactError):  # without friction there is no answer
            survey.add(name, scene.body_a, scene.body_b, scene.contact)
        if survey.requirements() != before:
            self._log.info(f"the scene requires {survey.requirements()}")


def stamp_of(message: BodyState | CollisionResult, now: Callable[[], int]) -> int:
    """When that was [ns]: now, if nobody said."""
    return nanoseconds(message.header.stamp) or now()
