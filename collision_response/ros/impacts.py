"""The service for one impact."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from ..recording import Record
from ..requirements import SceneSurvey
from ..resolve import resolve
from ..srv import ResolveCollision
from ..status import ImpactError, StatusCode
from . import convert
from .journal import Journal
from .parameters import LatestParameters
from .patience import in_one_part, when_not_too_early
from .request import complete
from .server import Work
from .states import LatestStates


@dataclass
class Impacts:
    """Answers requests.

    Attributes:
        parameters: of the node.
        states: of the bodies that it has heard of.
        journal: of the answers.
        survey: is told of every impact, to log what the scene requires; or ``None``.
        now: the time by the node's clock [ns].
        log: of the node.
    """

    interface = ResolveCollision
    name = "~/resolve_collision"
    parameters: LatestParameters
    states: LatestStates
    journal: Journal
    survey: SceneSurvey | None
    now: Callable[[], int]
    log: Any
    _warned: set[str] = field(default_factory=set, init=False)

    def answer(self, request: ResolveCollision.Request) -> Work:
        """The work for a request."""
        current = self.parameters.values
        look = partial(complete, request, self.states, current, self.now)
        used = yield from when_not_too_early(partial(in_one_part, look), current.max_state_wait)
        self._warn_of_coefficients(request)
        problem, coefficients = convert.problem_of(request, current)
        begin = time.perf_counter()
        impact = resolve(*problem)
        duration = time.perf_counter() - begin
        response = ResolveCollision.Response(success=True)
        result = response.result
        convert.write_answer(result, request, impact, coefficients)
        result.state_stamp_a, result.state_stamp_b = (state.stamp for state in used)
        result.state_age_a, result.state_age_b = (state.age for state in used)
        names = result.contact.body_a or "body_a", result.contact.body_b or "body_b"
        self.journal.enter(
            result,
            lambda stamp, number: Record(
                stamp,
                number,
                *names,
                problem.body_a,
                problem.body_b,
                problem.contact,
                problem.model,
                impact,
                duration,
            ),
        )
        if self.survey is not None:
            self._log_requirements(self.survey, " - ".join(names), problem)
        return response

    def refusal(self, request: ResolveCollision.Request, error: ImpactError) -> ResolveCollision.Response:
        """The response that says why there is no answer."""
        response = ResolveCollision.Response()
        convert.echo(response.result, request)
        convert.write_refusal(response.result, request.model, error)
        self.journal.refuse(response.result, error.code)
        return response

    def code(self, response: ResolveCollision.Response) -> StatusCode:
        """How the request ended."""
        return StatusCode(response.result.status.code)

    def _warn_of_coefficients(self, request: ResolveCollision.Request) -> None:
        for name in ("restitution", "friction"):
            if name not in self._warned and convert.only_one_body_says(name, request):
                self._warned.add(name)
                self.log.warning(
                    f"only one of two bodies has a coefficient of {name}: the parameter {name} is used; "
                    "this is said once"
                )

    def _log_requirements(self, survey: SceneSurvey, name: str, problem: convert.Problem) -> None:
        before = survey.requirements()
        with suppress(ImpactError):  # without friction there is no answer
            survey.add(name, problem.body_a, problem.body_b, problem.contact)
        after = survey.requirements()
        if after != before:
            self.log.info(f"the scene requires {after}")
