"""The trials of a listening study: the questions that a rater gets, and apart from them the key that holds the truth.

Trials are *blind*: their ids tell nothing. They are drawn by a seed and balanced. There are three kinds, after the
studies of the papers:

========  ==========================================  =======================  ======================
kind      a trial shows                               it asks                  as in
========  ==========================================  =======================  ======================
"pick"    one clip, with its own or with wrong music  is it harmonious?        harmony paper, Fig. 8
"choice"  two dances to the same music, side by side  which fits better?       harmony paper, Fig. 13
"rate"    one dance of some system                    four marks from 0 to 10  Music2Dance, Table 3
========  ==========================================  =======================  ======================

All raters of a study get the same trials, each in an order of their own, so that they can be compared trial by trial.
"""

import hashlib
import json
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import combinations
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.random import Generator as Rng

from harmolab.score import check_whole

Kind = Literal["pick", "choice", "rate"]

CHOICES = MappingProxyType({"pick": ("harmonious", "inharmonious"), "choice": ("left", "right")})
QUESTIONS: Mapping[str, str] = {
    "pick": "Does the dance fit its music?",
    "choice": "Which dance fits the music better?",
    "rate": "How good is this dance? Four marks, 0 to 10.",
}
# Sides of a dance that are marked, and what is asked of each.
MARKED = ("naturalness", "richness", "music", "sliding")
ASKED: Mapping[str, str] = {
    "naturalness": "Does it move like a person?",
    "richness": "Is it rich in movements?",
    "music": "Does it follow rhythm and melody?",
    "sliding": "Do the feet stand? (10: they never slide)",
}
MOST = 10  # the best mark
# The paper's scoring levels (Table 3).
ANCHORS: Mapping[int, str] = {
    0: "does not move with the music at all",
    2: "not like a person",
    4: "like a person, but does not match the music at all",
    6: "slightly natural, slightly matching, not rich, feet slide a lot",
    8: "natural, matching, not rich, no large sliding (junior dancers)",
    9: "natural, matching, not rich, no large sliding (ordinary dancers)",
    10: "natural, highly matching, no sliding, very rich (professionals)",
}
ID = re.compile(r"[0-9a-f]{12}")
MOST_TRIALS = 10_000


@dataclass(frozen=True)
class Item:
    """One clip, or one piece of music, and the versions of it that a study may show.

    Parameters
    ----------
    name : str
    versions : dict
        Condition or model -> source. For the kind "pick" the conditions are "true" and one or more wrong ones, such as
        ``{"true": ..., "lagged": ...}``; else they are models. A source is a text by which you find what is to be
        shown, such as the name of a file.

    Raises
    ------
    ValueError
        With fewer than two versions, or for what is no text.
    """

    name: str
    versions: Mapping[str, str]

    def __post_init__(self) -> None:
        if len(self.versions) < 2:
            raise ValueError(f"item {self.name!r} needs two or more versions, got {list(self.versions)}")
        if not all(isinstance(text, str) and text for text in (self.name, *self.versions, *self.versions.values())):
            raise ValueError(f"item {self.name!r}: name, versions and sources must be text that is not empty")


@dataclass(frozen=True)
class Trial:
    """One question for the rater's side: ids without meaning.

    Parameters
    ----------
    id : str, the same for all raters of the study
    stimuli : tuple of str; (left, right) for "choice", else one
    """

    id: str
    stimuli: tuple[str, ...]


@dataclass(frozen=True)
class TrialSet:
    """The trials of one rater, in order; it holds no condition, no model and no source.

    Parameters
    ----------
    study : str, the id that trials, key and answers share
    kind : "pick", "choice" or "rate"
    rater : str
    trials : tuple of Trial
    """

    study: str
    kind: Kind
    rater: str
    trials: tuple[Trial, ...]

    def __post_init__(self) -> None:
        n_stimuli = _n_stimuli(self.kind)
        _check_ids(self.study, *(name for trial in self.trials for name in (trial.id, *trial.stimuli)))
        if not self.rater or not self.rater.isprintable() or len(self.rater) > 100:
            raise ValueError(f"a rater needs a name of 1 to 100 printable characters, got {self.rater!r:.120}")
        if not self.trials or len({trial.id for trial in self.trials}) != len(self.trials):
            raise ValueError("a study needs one or more trials, each with an id of its own")
        if any(len(trial.stimuli) != n_stimuli for trial in self.trials):
            raise ValueError(f"every trial of a {self.kind!r} study must have {n_stimuli} stimuli")

    def __len__(self) -> int:
        return len(self.trials)

    @property
    def choices(self) -> tuple[str, str]:
        """The two possible answers; ("", "") where marks are asked."""
        return CHOICES.get(self.kind, ("", ""))

    @property
    def question(self) -> str:
        """The question that the rater answers."""
        return QUESTIONS[self.kind]

    def ordered_for(self, rater: str) -> "TrialSet":
        """The same trials in the order of another rater, which follows from the study and the rater's name alone."""
        rng = _rng(int(self.study, 16), *rater.encode())
        trials = sorted(self.trials, key=lambda trial: trial.id)
        return TrialSet(self.study, self.kind, rater, tuple(trials[place] for place in rng.permutation(len(trials))))


@dataclass(frozen=True)
class KeyEntry:
    """The truth about one trial; not for the rater's eyes.

    Parameters
    ----------
    item : str, name of the clip or the music
    versions : tuple of str; the condition, or the models on the left and on the right
    sources : tuple of str, of the stimuli, in the same order
    right : str or None, the right answer; None if there is none, as between two models
    """

    item: str
    versions: tuple[str, ...]
    sources: tuple[str, ...]
    right: str | None


@dataclass(frozen=True)
class Key:
    """The truth about every trial of a study; the same for all raters.

    Parameters
    ----------
    study : str
    kind : "pick", "choice" or "rate"
    trials : mapping from the id of a trial to KeyEntry
    """

    study: str
    kind: Kind
    trials: Mapping[str, KeyEntry]

    def __post_init__(self) -> None:
        n_stimuli = _n_stimuli(self.kind)
        _check_ids(self.study, *self.trials)
        for name, entry in self.trials.items():
            if not len(entry.versions) == len(entry.sources) == n_stimuli:
                raise ValueError(f"trial {name} must have {n_stimuli} versions and sources")
            if entry.right not in (None, *CHOICES.get(self.kind, ())):
                raise ValueError(f"trial {name}: right answer must be in {CHOICES[self.kind]}, got {entry.right!r}")
        object.__setattr__(self, "trials", MappingProxyType(dict(self.trials)))


def make_trials(items: Sequence[Item], *, kind: Kind, n: int, seed: int, rater: str, truth: str = "true") -> TrialSet:
    """The blind trials of one rater of a listening study; equal arguments give equal trials.

    Parameters
    ----------
    items : sequence of Item
        All with the same versions.
    kind : "pick", "choice" or "rate"
        "pick", is this clip harmonious? Half of the trials are true, the other half is shared equally by the wrong
        conditions, and no clip comes twice. "choice", which of two dances fits better? Every pair of versions comes
        equally often, each of the two equally often on the left. "rate", four marks for a dance. Every version comes
        equally often, and no dance twice.
    n : int
        Number of trials; the balance has to come out even.
    seed : int
        Of the draw of trials. Keep it from raters: with the items it gives the answers away.
    rater : str
        Name of the rater, which decides the order.
    truth : str
        The version that is right. Models have none, and then no answer is wrong.

    Returns
    -------
    TrialSet

    Raises
    ------
    ValueError
        For items that do not match each other, or an `n` that cannot be balanced; the message says which can.

    Examples
    --------
    >>> clips = [Item(f"clip {i}", {"true": f"{i}.npz", "lagged": f"{i} late.npz"}) for i in range(4)]
    >>> len(make_trials(clips, kind="pick", n=4, seed=1, rater="Ada"))
    4
    """
    key = make_key(items, kind=kind, n=n, seed=seed, truth=truth)
    ids = _random_ids(n * (1 + _n_stimuli(kind)), seed)[n:]
    trials = [Trial(name, tuple(ids[place::n])) for place, name in enumerate(key.trials)]
    return TrialSet(key.study, kind, rater, tuple(trials)).ordered_for(rater)


def make_key(items: Sequence[Item], *, kind: Kind, n: int, seed: int, truth: str = "true") -> Key:
    """The key to the trials of a study: which version each of them shows, and which answer is right.

    It is the same for all raters. Arguments and errors are those of `make_trials`.
    """
    _n_stimuli(kind)  # checks the kind
    versions = _common_versions(items)
    rng = _rng(seed, 0)
    plan = {"pick": _plan_pick, "choice": _plan_choice, "rate": _plan_rate}[kind](items, versions, n, truth, rng)
    entries = [plan[place] for place in rng.permutation(n)]
    study = hashlib.sha256(json.dumps([kind, int(seed), [asdict(one) for one in entries]]).encode()).hexdigest()[:12]
    return Key(study, kind, dict(zip(_random_ids(n, seed), entries, strict=True)))


def _plan_pick(items: Sequence[Item], versions: Sequence[str], n: int, truth: str, rng: Rng) -> list[KeyEntry]:
    """A clip for every trial, half of them true."""
    if truth not in versions:
        raise ValueError(f"items need a version {truth!r}, which is the right music; they have {list(versions)}")
    wrong = [version for version in versions if version != truth]
    _check_count(n, 2 * len(wrong), len(items), "clips")
    conditions = [truth] * (n // 2) + wrong * (n // (2 * len(wrong)))
    clips = [items[place] for place in rng.permutation(len(items))[:n]]
    return [
        KeyEntry(clip.name, (one,), (clip.versions[one],), "harmonious" if one == truth else "inharmonious")
        for clip, one in zip(clips, conditions, strict=True)
    ]


def _plan_choice(items: Sequence[Item], versions: Sequence[str], n: int, truth: str, rng: Rng) -> list[KeyEntry]:
    """Items for every pair of versions, half of them with the first on the left."""
    pairs = list(combinations(versions, 2))
    _check_count(n, 2 * len(pairs), len(items) * len(pairs), "pairs")
    each = n // len(pairs)
    plan = []
    for pair in pairs:
        for turn, place in enumerate(rng.permutation(len(items))[:each]):
            sides = pair if turn % 2 else pair[::-1]
            right = CHOICES["choice"][sides.index(truth)] if truth in sides else None
            plan.append(KeyEntry(items[place].name, sides, tuple(items[place].versions[side] for side in sides), right))
    return plan


def _plan_rate(items: Sequence[Item], versions: Sequence[str], n: int, truth: str, rng: Rng) -> list[KeyEntry]:
    """Dances of every version; no answer is right."""
    _check_count(n, len(versions), len(items) * len(versions), "dances")
    return [
        KeyEntry(items[place].name, (version,), (items[place].versions[version],), None)
        for version in versions
        for place in rng.permutation(len(items))[: n // len(versions)]
    ]


def is_answer(kind: str, choice: str) -> bool:
    """True if a text can be the answer to a trial of this kind."""
    if kind != "rate":
        return choice in CHOICES[kind]
    parts = choice.split(" ")
    return len(parts) == len(MARKED) and all(re.fullmatch(r"\d{1,2}", part) and int(part) <= MOST for part in parts)


def marks_of(choice: str) -> tuple[int, ...]:
    """The marks of an answer, in the order of `MARKED`; ValueError where it is no such answer.

    >>> marks_of("8 7 10 3")
    (8, 7, 10, 3)
    """
    if not is_answer("rate", choice):
        raise ValueError(f"marks are {len(MARKED)} whole numbers from 0 to {MOST}, got {choice!r:.60}")
    return tuple(int(part) for part in choice.split(" "))


def _check_count(n: int, multiple: int, most: int, what: str) -> None:
    """ValueError, with the numbers that would do, unless `n` trials come out even."""
    if isinstance(n, bool) or not isinstance(n, int | np.integer) or n < 1 or n % multiple:
        raise ValueError(f"n must be a multiple of {multiple} above 0, so all conditions come equally often; got {n!r}")
    if n > min(most, MOST_TRIALS):
        raise ValueError(f"n = {n} trials, but there are only {most} {what} and none comes twice; choose a smaller n")


def _common_versions(items: Sequence[Item]) -> tuple[str, ...]:
    """The versions that all items have; ValueError if they differ or a name or source comes twice."""
    if not items:
        raise ValueError("a study needs items; got none")
    versions = tuple(sorted(items[0].versions))
    for item in items:
        if tuple(sorted(item.versions)) != versions:
            raise ValueError(f"item {item.name!r} has the versions {sorted(item.versions)}, others {list(versions)}")
    names = [item.name for item in items]
    sources = [source for item in items for source in item.versions.values()]
    for texts, what in ((names, "name"), (sources, "source")):
        text, count = Counter(texts).most_common(1)[0]
        if count > 1:
            raise ValueError(f"the {what} {text!r} comes twice; each must be of its own")
    return versions


def _rng(seed: int, *stream: int) -> Rng:
    check_whole(seed=seed)
    return np.random.default_rng([int(seed), *stream])


def _random_ids(count: int, seed: int) -> list[str]:
    """Ids that follow from the seed alone: a longer list starts like a shorter one."""
    rng = _rng(seed, 1)
    return [rng.bytes(6).hex() for _ in range(count)]


def _n_stimuli(kind: object) -> int:
    """Number of stimuli in a trial; ValueError for a kind that is none of them."""
    if not isinstance(kind, str) or kind not in QUESTIONS:
        raise ValueError(f"kind must be 'pick', 'choice' or 'rate', got {kind!r:.60}")
    return 2 if kind == "choice" else 1


def _check_ids(*ids: object) -> None:
    for one in ids:
        if not isinstance(one, str) or not ID.fullmatch(one):
            raise ValueError(f"an id must be twelve hexadecimal digits, got {one!r:.60}")
