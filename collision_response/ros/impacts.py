"""The service for one impact."""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from ..msg import CollisionResult
from ..recording import Record
from ..requirements import SceneSurvey
from ..resolve import resolve
from ..srv import ResolveCollision
from ..status import ImpactError, StatusCode
from . import convert
from .answer_log import AnswerLog
from .body_lookup import TEXTS, StateFinder, check_texts, complete
from .parameters import LatestParameters
from .round_robin import Steps
from .states import LatestStates


@dataclass
class ImpactService:
    """Answers ``~/resolve_collision``. A ``survey`` collects all impacts, to log what the scene requires."""

    interface = ResolveCollision
    name = "~/resolve_collision"
    has_budget = True
    parameters: LatestParameters
    states: LatestStates
    answer_log: AnswerLog
    survey: SceneSurvey | None
    log: Any
    _spare: ResolveCollision.Response | None = field(default=None, init=False)
    _warned: set[str] = field(default_factory=set, init=False)

    def answer(
        self, request: ResolveCollision.Request
    ) -> Steps[tuple[StatusCode, ResolveCollision.Response]]:
        """Compute the response to a request, in steps."""
        parameters = self.parameters.values
        check_texts(request, TEXTS)
        contact = request.contact
        finder = StateFinder("contact.header", contact.header, request.not_before, self.states, parameters)
        states_used = yield from finder.wait(partial(complete, request, finder))
        problem, coefficients = convert.problem_of(request, parameters)
        self._warn_of_coefficients(request, coefficients)

        start = time.perf_counter()
        impact = resolve(*problem)
        duration = time.perf_counter() - start

        response, self._spare = self._spare or ResolveCollision.Response(), None
        response.success, result = True, response.result
        convert.write_answer(result, request, impact, coefficients)
        (result.state_stamp_a, result.state_age_a), (result.state_stamp_b, result.state_age_b) = states_used
        a, b = result.contact.body_a or "body_a", result.contact.body_b or "body_b"
        self.answer_log.add(
            result, lambda stamp, sequence: Record(stamp, sequence, a, b, *problem, impact, duration)
        )
        if self.survey is not None:
            self._log_requirements(self.survey, f"{a} - {b}", problem)
        return impact.status, response

    def refusal(self, request: ResolveCollision.Request, error: ImpactError) -> ResolveCollision.Response:
        """Return the response that says why there is no answer."""
        response = ResolveCollision.Response()
        convert.echo_contact(response.result, request)
        convert.write_refusal(response.result, request.model, error)
        self.answer_log.add_refusal(response.result)
        return response

    def prepare(self) -> None:
        """Make the next response, which takes as long as a third of an answer. No client waits for this."""
        self._spare = self._spare or ResolveCollision.Response()

    def _warn_of_coefficients(
        self, request: ResolveCollision.Request, used: convert.ContactCoefficients
    ) -> None:
        for name in ("restitution", "friction"):
            of_a, of_b = getattr(request.body_a, name), getattr(request.body_b, name)
            is_parameter = getattr(used, name).source == CollisionResult.FROM_PARAMETER
            if is_parameter and of_a != of_b and name not in self._warned:
                self._warned.add(name)
                self.log.warning(
                    f"only one of two bodies has a coefficient of {name}, so the parameter {name} is used "
                    "(logged once)"
                )

    def _log_requirements(self, survey: SceneSurvey, name: str, problem: convert.ImpactProblem) -> None:
        before = survey.requirements()
        with suppress(ImpactError):  # the survey also resolves it without friction, which may be refused
            survey.add(name, *problem[:3])
        after = survey.requirements()
        if after != before:
            self.log.info(f"the scene requires {after}")
