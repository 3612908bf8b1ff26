"""Raters that are not people, of known skill: they test the analysis and are called simulated wherever they appear."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from harmolab.lab.listening.answers import SIMULATED, Answer
from harmolab.lab.listening.trials import MARKED, MOST, Key, TrialSet


@dataclass(frozen=True)
class SimulatedRater:
    """A rater that is right with a known probability.

    Parameters
    ----------
    skill : float in [0, 1], probability of a right answer; 0.5 is guessing
    seed : int
    prefers : str, optional
        The version that it takes for right in trials whose key knows no right answer (two models). Marks of its dances
        are higher, the more so the more skill.

    Examples
    --------
    >>> SimulatedRater(0.8, seed=3).name
    'simulated-3'
    """

    skill: float
    seed: int
    prefers: str | None = None

    def __post_init__(self) -> None:
        if not 0.0 <= self.skill <= 1.0:
            raise ValueError(f"skill must be between 0 and 1, got {self.skill}")
        if self.seed < 0:
            raise ValueError(f"seed must not be negative, got {self.seed}")

    @property
    def name(self) -> str:
        """The rater's name, for `make_trials` too."""
        return f"{SIMULATED}{self.seed}"

    def answers(self, trials: TrialSet, key: Key) -> tuple[Answer, ...]:
        """An answer to every trial; unlike a person, it looks at the key.

        Raises
        ------
        ValueError
            If the trials are another rater's or another study's, or a trial has no right answer and the rater prefers
            neither of the two.
        """
        if trials.study != key.study or trials.rater != self.name:
            raise ValueError(f"{self.name} was given trials of {trials.rater}, study {trials.study}")
        successes = np.random.default_rng([self.seed, int(trials.study, 16)]).random(len(trials)) < self.skill
        if trials.kind == "rate":
            return tuple(self._marked(trials, key))
        rows = []
        for trial, is_right in zip(trials.trials, successes, strict=True):
            right = self._right(key, trial.id)
            choice = right if is_right else trials.choices[1 - trials.choices.index(right)]
            rows.append(Answer(trials.study, self.name, trial.id, choice, simulated=True))
        return tuple(rows)

    def _marked(self, trials: TrialSet, key: Key) -> list[Answer]:
        """Four marks for every dance: 5, two more or less by skill and version, and chance."""
        rng = np.random.default_rng([self.seed, int(trials.study, 16)])
        answers = []
        for trial in trials.trials:
            is_liked = key.trials[trial.id].versions[0] == self.prefers
            centre = MOST / 2 + (2 if is_liked else -2) * (2 * self.skill - 1)
            marks = np.clip(np.round(rng.normal(centre, 1.0, len(MARKED))), 0, MOST).astype(int)
            answers.append(Answer(trials.study, self.name, trial.id, " ".join(map(str, marks)), simulated=True))
        return answers

    def _right(self, key: Key, trial: str) -> str:
        entry = key.trials[trial]
        if entry.right is not None:
            return entry.right
        if self.prefers not in entry.versions:
            raise ValueError(f"no answer is right between {entry.versions}; give prefers= one of them")
        return ("left", "right")[entry.versions.index(self.prefers)]
