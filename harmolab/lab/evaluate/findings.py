"""The first sentences of a table: what its harmony says of each system, and whether it says anything at all."""

from collections.abc import Iterator

from harmolab.lab.evaluate.as_text import number_text
from harmolab.lab.evaluate.evaluation import Evaluation
from harmolab.lab.evaluate.pairing import OTHER_SONG, RECORDED
from harmolab.lab.evaluate.summary import FEWEST_SONGS, Difference

# Two dancers are called alike only where their difference is surely smaller than this part of what recorded dances have
# with their own songs and not with others.
ALIKE = 0.5


def findings(evaluation: Evaluation) -> Iterator[str]:
    """A sentence for each system: its harmony above chance beside that of the recorded dances, and its likeness.

    Before them stands what the controls deny: with too few songs, or where recorded dances are no more in harmony with
    their own songs than with others, no system is compared.
    """
    if doubt := harmony_doubt(evaluation):
        yield doubt
    for system in evaluation.systems:
        likely = _likeness(evaluation, system)
        mean, recorded = (evaluation.means.get((row, "harmony")) for row in (system, RECORDED))
        if mean is None or recorded is None:
            yield f"{system}: no harmony above chance could be measured.{likely}"
            continue
        own, theirs = number_text(mean.mean), number_text(recorded.mean)
        numbers = f"harmony {own} above chance, that of the recorded dances {theirs}"
        relation = "" if doubt else _relation(evaluation, system)
        yield f"{system} {relation} ({numbers}).{likely}" if relation else f"{system}: {numbers}.{likely}"


def _likeness(evaluation: Evaluation, system: str) -> str:
    """A sentence on the likeness of a system to recorded dancers, with a blank before it; "" without one."""
    mean = evaluation.means.get((system, "likeness"))
    if mean is None:
        return ""
    songs = evaluation.counts[system].songs
    judged = "" if mean.songs == songs else f" to the {mean.songs} of {songs} songs where that can be judged"
    return f" {mean.mean:.0%} of its dances{judged} move like recorded dancers{evaluation.over_songs(system)}."


def harmony_doubt(evaluation: Evaluation) -> str:
    """The reason why harmony compares no system with the recorded dances; "" where it does.

    It does where, over `FEWEST_SONGS` songs or more, recorded dances are clearly more in harmony with their own songs
    than with others.
    """
    control = difference_of(evaluation, RECORDED, OTHER_SONG)
    songs = evaluation.counts[RECORDED].songs if control is None else control.songs
    if control is None or songs < FEWEST_SONGS:
        words = "1 song is" if songs == 1 else f"{songs} songs are"
        return f"{words} too few to say how the dances go with their music; {FEWEST_SONGS} are needed at the least."
    if control.low > 0:
        return ""
    return (
        "Harmony says nothing on these data: the recorded dances are not clearly more in harmony with their own songs "
        f"than with others (difference {number_text(control.mean)}, 95 % interval {_interval(control)}, {songs} songs)."
    )


def _relation(evaluation: Evaluation, system: str) -> str:
    """The words between the system and its numbers, where harmony tells recorded dances from those with other songs."""
    one, control = (difference_of(evaluation, *rows) for rows in ((system, RECORDED), (RECORDED, OTHER_SONG)))
    songs = 0 if one is None else one.songs
    if one is None or control is None or songs < FEWEST_SONGS:
        few = f"{songs} common song{' is' if songs == 1 else 's are'} too few"
        return f"cannot be compared with the recorded dances: {few if songs else 'these are to other songs'}"
    if one.is_clear:
        less = f"less than the recorded dances, {_beside_other_songs(evaluation, system)}"
        return f"goes with its music {'more than the recorded dances' if one.low > 0 else less}"
    if max(-one.low, one.high) < ALIKE * control.mean:
        return "cannot be told from the recorded dances by its harmony with the music"
    return (
        f"may go with its music as the recorded dances do, or not: {songs} songs are too few to tell, the 95 % "
        f"interval of the difference is {_interval(one)}"
    )


def _beside_other_songs(evaluation: Evaluation, system: str) -> str:
    """The words on a system that is below the recorded dances: is it above these with another song?"""
    one = difference_of(evaluation, system, OTHER_SONG)
    if one is None or not one.is_clear:
        return "and cannot be told from the same with another song"
    return "but more than the same with another song" if one.low > 0 else "and less than the same with another song"


def difference_of(evaluation: Evaluation, a: str, b: str, measure: str = "harmony") -> Difference | None:
    """The difference a - b of two rows of the table; None where there is none."""
    for one in evaluation.differences:
        if one.measure == measure and {one.a, one.b} == {a, b}:
            return one if one.a == a else Difference(measure, a, b, -one.mean, -one.high, -one.low, one.songs)
    return None


def _interval(one: Difference) -> str:
    return f"{number_text(one.low)} to {number_text(one.high)}"
