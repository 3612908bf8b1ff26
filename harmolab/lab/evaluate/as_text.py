"""The table of an evaluation as text: CSV, JSON, remarks and methods."""

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from importlib.metadata import version
from typing import Any

import pandas as pd

from harmolab.lab.evaluate.evaluation import Evaluation
from harmolab.lab.evaluate.measured import PIECE
from harmolab.lab.evaluate.pairing import FROZEN, OTHER_SONG, RECORDED
from harmolab.lab.evaluate.protocols import protocol_of
from harmolab.lab.evaluate.rows import ASSUMED, ASSUMED_OF_EDGE, LIMIT_DANCES
from harmolab.lab.evaluate.sets import FEATURE_DANCES, FEATURES, MOST_SONGS, SetNumber
from harmolab.lab.evaluate.summary import FEWEST_SONGS, Mean, measure_of
from harmolab.metrics.features import GEOMETRIC_FEATURES
from harmolab.params import DANCE_PATTERNS, HarmonyParams

# Remarks on a table, and the paragraph on how it was made, to paste into a paper

MUSICAL = (  # of which more must be reached with the own song than with another
    *("harmony", "harmony_dance", "paper_harmony", "paper_hit_rate"),
    *("beat_align_motion", "beat_align_music", "beat_hit_rate", "mir_eval_f"),
)
PUBLISHED_MUSICAL = ("BeatAlign", "BAS")  # the same of protocols
FEW = 100  # dances below which a distance of features says little
ENOUGH = 12  # recorded dances from which on limits let pass nine in ten of the others, among 23 of ballroom
_NARROW = (
    " Those of so few are narrow: of 23 recordings of ballroom dances, limits from four let two thirds of the others "
    "pass, limits from one let a tenth."
)
KINETIC = 72  # numbers of the kinetic features of SMPL's joints


class Note(str):
    """A remark on a table, and `about`: the names of the rows and measures that it concerns; none where it is on all.

    >>> Note("ours has 2 songs", "ours").about
    ('ours',)
    """

    __slots__ = ("about",)
    about: tuple[str, ...]

    def __new__(cls, text: str, *about: str) -> "Note":
        self = super().__new__(cls, text)
        self.about = about
        return self


def table_notes(evaluation: Evaluation) -> Iterator[Note]:
    """Remarks that a reader needs beside this table: small samples, missing columns and controls, doubtful harmony."""
    counts = evaluation.counts
    if OTHER_SONG not in evaluation.controls:
        yield Note(
            "The recorded dances have one song only, so there is no row of recorded dances with another song.", RECORDED
        )
    if len(evaluation.systems) > 1 and not any(evaluation.ranks.values()):
        yield Note(f"No system has a rank: no difference excludes 0 over {FEWEST_SONGS} common songs or more.")
    if few := min((count.songs for count in counts.values() if 1 < count.songs < FEWEST_SONGS), default=0):
        words = f"{few} songs reaches from their least mean to their largest at most, and holds the true one in some"
        yield Note(f"An interval over {words} {1 - 0.5 ** (few - 1):.0%} of such tables, where 95 % are meant.")
    yield from _unanimous_notes(evaluation)
    yield from _doubtful_inputs(evaluation)
    yield from _control_notes(evaluation)
    yield from _published_notes(evaluation)
    yield from _distance_notes(evaluation)
    for row in evaluation.systems:
        if (row, "likeness") in evaluation.means and (likely := evaluation.means[row, "likeness"].mean) < 0.5:
            yield Note(
                f"Only {likely:.0%} of the dances of {row} move like the recorded dancers"
                f"{evaluation.over_songs(row)}: its harmony means little, "
                "as that of a statue on a turntable does.",
                row,
            )
        if len(evaluation.systems) > 1 and counts[row].songs < FEWEST_SONGS:
            yield Note(f"{row} has {counts[row].songs} songs; no rank is given below {FEWEST_SONGS}.", row)
    if "likeness" in evaluation.measures and evaluation.options.limits is None:
        yield Note(
            "The recorded dances gave no limits of likeness; those of four ballroom dances that are shipped stand in.",
            "likeness",
        )
    elif "likeness" in evaluation.measures:
        yield Note(
            "The limits of likeness are the recorded dances' own, so that it is no finding that these pass."
            + (_NARROW if counts[RECORDED].dances < ENOUGH else ""),
            "likeness",
        )
    yield from input_notes(evaluation)


def _unanimous_notes(evaluation: Evaluation) -> Iterator[Note]:
    """A remark on each share that is 0 or 1 in all songs, so that resampling them gives an interval without width."""
    for name in ("significant", "likeness"):
        means = {row: evaluation.means.get((row, name), NO_MEAN) for row in evaluation.systems}
        songs = {row: mean.songs for row, mean in means.items() if mean.songs > 1 and mean.mean in (0.0, 1.0)}
        if songs:
            yield Note(
                f'All songs of {", ".join(songs)} agree in the measure "{measure_of(name).words}", so that its '
                f"interval has no width. By {min(songs.values())} songs that agree, the true share may lie up to "
                f"{1 - 0.025 ** (1 / min(songs.values())):.0%} away.",
                *songs,
                name,
            )


def input_notes(evaluation: Evaluation) -> Iterator[Note]:
    """Remarks on the dances themselves: how they were read, where they begin, what is odd, and which are missing."""
    yield from _assumptions(evaluation)
    yield from _starts(evaluation)
    for row in (*evaluation.systems, RECORDED):
        if dances := _counted(evaluation, row, "odd"):
            yield Note(f"Odd in {row} (dances): {dances}. The column oddities of clips.csv says where.", row)
    if evaluation.missing:
        yield Note(f"Measured: {measured_text(evaluation)}. The others are in no number, and are listed with reasons.")


def measured_text(evaluation: Evaluation) -> str:
    """The number of dances of each row that were measured, "22 of 40" where some were not."""
    return ", ".join(f"{evaluation.counts[row].text} dances of {row}" for row in (*evaluation.systems, RECORDED))


def _starts(evaluation: Evaluation) -> Iterator[Note]:
    """A remark on the dances that are taken to begin with their song, since nothing says where they begin."""
    rows = (*evaluation.systems, RECORDED)
    begins = {row: evaluation.facts[row]["begins"] for row in rows}
    assumed = {row: counts[ASSUMED] + counts[ASSUMED_OF_EDGE] for row, counts in begins.items()}
    if not any(assumed.values()):
        return
    listed = ", ".join(f"{row} ({assumed[row]} of {evaluation.counts[row].dances})" for row in rows if assumed[row])
    edge = ", ".join(row for row in rows if begins[row][ASSUMED_OF_EDGE])
    of_edge = f" EDGE wrote those of {edge}: its test.py begins anywhere in the song, and does not say where."
    yield Note(
        f"Taken to begin with their song, since nothing says where in it they begin: {listed}."
        f"{of_edge if edge else ''} Of a dance that begins elsewhere, harmony and the measures of beats say nothing: "
        "name its start in the column offset of --pairs.",
        *(row for row in rows if assumed[row]),
    )


def _control_notes(evaluation: Evaluation) -> Iterator[Note]:
    """Remarks on measures in which the controls do not stand where they must."""
    songs = evaluation.counts[RECORDED].songs
    if OTHER_SONG in evaluation.controls and songs < FEWEST_SONGS:
        yield Note(
            f"The recorded dances are to {songs} songs, too few to see which measures tell them from "
            f"the same with another song: {FEWEST_SONGS} are needed.",
            RECORDED,
            OTHER_SONG,
        )
    if deaf := list(deaf_measures(evaluation)):
        yield Note(
            "These measures do not tell the recorded dances from the same with another song, so that a rank by them "
            f"may say nothing about the music: {'; '.join(measure_of(name).words for name in deaf)}.",
            *deaf,
        )
    if still := list(_won_by_a_held_pose(evaluation)):
        yield Note(
            "By these measures a held pose is better than the recorded dances, so that alone they say nothing about "
            f"dancing: {'; '.join(measure_of(name).words for name in still)}.",
            *still,
        )


def _distance_notes(evaluation: Evaluation) -> Iterator[Note]:
    """Remarks on Fréchet distances that are missing, of few dances, or below 0."""
    for name in FEATURES:
        if missing := [row for row in evaluation.systems if (row, f"fid_{name}") not in evaluation.sets]:
            yield Note(f"No FID on {name} features for {', '.join(missing)}: {_reason(evaluation, name)}.", *missing)
    frechet = [name for name in evaluation.set_measures if name.startswith("fid_")]
    distances = [one for (row, name), one in evaluation.sets.items() if name in frechet and row != RECORDED]
    if distances and min(one.n for one in distances) < FEW:
        yield Note(
            f"Fréchet distances rest on {min(one.n for one in distances)} dances at the least. The bias of small "
            "samples is estimated and taken off, but some stays below twice as many dances as features (144 dances for "
            "kinetic features), and the more, the fewer the dances are. So systems with different numbers of dances do "
            f"not compare. Chance stays too: below about {FEW} dances small differences mean nothing.",
            *frechet,
        )
    if below := dict.fromkeys(name for (_, name), one in evaluation.sets.items() if name in frechet and one.value < 0):
        yield Note(
            "A Fréchet distance below 0 is chance, as two samples of one distribution have it in every second case.",
            *below,
        )


def _doubtful_inputs(evaluation: Evaluation) -> Iterator[Note]:
    """Remarks on means over fewer songs than others, and on frame rates that differ."""
    rows = (*evaluation.systems, RECORDED)
    rates = {row: _listed(evaluation.facts[row]["fps"]) for row in rows}
    for name, reason in (
        ("harmony", "too short, or with too few beats, to be judged"),
        ("likeness", "shorter than 10 s, two-dimensional, or without names of joints"),
    ):
        songs = evaluation.songs[name].groupby(level="system").agg(["count", "size"])
        if few := [f"{row} {one['count']} of {one['size']}" for row, one in songs.iterrows() if one.nunique() > 1]:
            yield Note(
                f'The measure "{measure_of(name).words}" is of fewer songs than there are: {", ".join(few)}. The other '
                f"dances are {reason}. Means over different songs do not compare; the differences are over common "
                "songs.",
                name,
            )
    if len(set(rates.values())) > 1:
        listed = "; ".join(f"{row}: {rate}" for row, rate in rates.items())
        yield Note(
            f"The frame rates differ ({listed}). Harmony and the beat measures hardly change with them; physical foot "
            "contact, jerk and Fréchet distances may by some per cent: bring all to one rate before you rank by these.",
            *("pfc", "jerk"),
            *(name for name in evaluation.set_measures if name.startswith("fid_")),
        )


def deaf_measures(evaluation: Evaluation) -> Iterator[str]:
    """The `MUSICAL` measures that are not clearly higher for recorded dances with their own songs."""
    for one in evaluation.differences:
        is_musical = one.measure in MUSICAL or one.measure.partition(" ")[2] in PUBLISHED_MUSICAL
        if {one.a, one.b} == {RECORDED, OTHER_SONG} and is_musical:
            low = one.low if one.a == RECORDED else -one.high
            if one.songs >= FEWEST_SONGS and not low > 0:
                yield one.measure


def _won_by_a_held_pose(evaluation: Evaluation) -> Iterator[str]:
    """The measures with a direction in which a held pose is clearly better than the recorded dances."""
    for one in evaluation.differences:
        if {one.a, one.b} == {RECORDED, FROZEN} and one.is_clear:
            gain = one.mean if one.a == FROZEN else -one.mean
            if gain * measure_of(one.measure).better > 0:
                yield one.measure


def _published_notes(evaluation: Evaluation) -> Iterator[Note]:
    """Remarks on the columns of protocols: those that are missing, small samples, and numbers that mean nothing."""
    columns = (*evaluation.measures, *evaluation.set_measures)
    for protocol in evaluation.settings.protocols:
        own = [name for name in columns if name.startswith(f"{protocol} ")]
        if not own:
            yield Note(f"No dance has numbers of {protocol}: they are of joints that these bodies do not have by name.")
        if missing := protocol_of(protocol).missing:
            yield Note(f"{protocol}: {missing}", *own)
        distances = [name for name in own if measure_of(name).words.startswith(f"{protocol} FID")]
        sizes = [one.n for (row, name), one in evaluation.sets.items() if name in distances and row != RECORDED]
        if sizes and min(sizes) < FEW:
            sides = [one for (row, name), one in evaluation.sets.items() if name in distances and row == RECORDED]
            truth = f" That of recorded dances is of {sides[0].n} beside {sides[0].n_recorded:g}." if sides else ""
            yield Note(
                f"FID of {protocol} rests on {min(sizes)} dances at the least and keeps the bias of small samples, as "
                f"published: it compares only with that of as many dances, beside as many recorded dances.{truth}",
                *distances,
            )
    yield from _constant_notes(evaluation)


def _constant_notes(evaluation: Evaluation) -> Iterator[Note]:
    """Remarks on the numbers that rest on features in which the reference does not vary, and the dances do."""
    columns: dict[tuple[str, tuple[int, ...], tuple[str, ...]], list[str]] = {}
    for name in evaluation.set_measures:
        if places := constant_features(evaluation, name):
            rows = tuple(row for row in evaluation.rows if evaluation.sets.get((row, name), NO_NUMBER).constant)
            columns.setdefault((name[-1], places, rows), []).append(name)
    for (letter, places, rows), names in columns.items():
        kind, count = ("kinetic", KINETIC) if letter == "k" else ("geometric", len(GEOMETRIC_FEATURES))
        numbered = (GEOMETRIC_FEATURES[one] if kind == "geometric" else f"number {one + 1}" for one in places)
        yield Note(
            f"{', '.join(names)}: {len(places)} of {count} {kind} features are constant in the reference: meaningless "
            f"for {', '.join(rows)}, where they are not, as the published codes divide by the spread + 1e-10. They "
            f"are: {', '.join(numbered)}.",
            *names,
        )


def constant_features(evaluation: Evaluation, name: str) -> tuple[int, ...]:
    """The places of the features behind a number of sets that are constant in the reference and not in a row of it."""
    places = {place for (_, each), one in evaluation.sets.items() if each == name for place in one.constant}
    return tuple(sorted(places))


def _reason(evaluation: Evaluation, name: str) -> str:
    if name != "pose":
        words = {"kinetic": "the joints are not those of the recorded dances"}
        reason = words.get(name, "they need joints by name that the body does not have")
        return f"{reason}, or there are fewer than four dances"
    if evaluation.options.pose_net is None:
        return "torch is not installed"
    return "the pose network knows other joints (--pose-net names another), or the dances are too few or too short"


def methods_paragraph(evaluation: Evaluation) -> str:
    """The way the table was made, to be pasted into a paper: at most 200 words, however many systems there are."""
    counts, settings, protocols = evaluation.counts, evaluation.settings, evaluation.settings.protocols
    dances = number_range(counts[row].dances for row in evaluation.systems)
    rates = number_range(float(rate) for row in evaluation.rows for rate in evaluation.facts[row]["fps"])
    number = len(evaluation.systems)
    beats = sum((evaluation.facts[row]["beats"] for row in (*evaluation.systems, RECORDED)), Counter[str]())
    published = (
        f" Columns of {', '.join(protocols)} follow these published codes, faults and small-sample bias included, as "
        "means over dances."
    )
    return (
        f"{'The system' if number == 1 else f'Each of {number} systems'} has {dances} dances; beside them stand "
        f"{counts[RECORDED].dances} recorded dances, these with another song, and a held pose ({rates} frames per "
        f"second). Music beats were annotated for {beats['annotated']} dances and tracked for {beats['tracked']}. "
        "Harmony above chance is the percentile rank of the music beats among all moments of the movement's shape (0: "
        "chance, 1: the most). Harmony h and hit rate (reaction delay "
        f"{HarmonyParams.paper().reaction_delay:g} s) stand beside what as many beats at random moments reach. Beat "
        "alignment has the widths of AIST++ in seconds. Fréchet distances are from the recorded dances, in their "
        "units, less the estimated bias of small samples. Likeness is the share of dances whose thirteen measures of "
        f"movement lie within the limits of recorded dancers.{published if protocols else ''} Intervals are 95 %, from "
        f"{settings.resamples} resamplings of the songs (seed {settings.seed}), expanded for small samples (Hesterberg "
        "2015); dances to one song, and seeds, are averaged before. Differences are paired by song; ranks need an "
        f"interval that excludes 0 over {FEWEST_SONGS} songs, uncorrected for the number of comparisons. Computed with "
        f"harmolab {version('harmolab')}."
    )


def number_range(numbers: Iterable[float]) -> str:
    """The least and the largest of some numbers."""
    ordered = sorted(numbers)
    few, many = f"{ordered[0]:g}", f"{ordered[-1]:g}"
    return few if few == many else f"{few} to {many}"


def full_methods(evaluation: Evaluation) -> str:
    """All of the way the table was made: data, frame rates, beats, settings, statistics, and the protocols' remarks."""
    parts = (_data(evaluation), _measurement(evaluation), _statistics(evaluation), _protocols(evaluation))
    return "\n\n".join(text for part in parts if (text := " ".join(part)))


def _data(evaluation: Evaluation) -> Iterator[str]:
    counts, facts = evaluation.counts, evaluation.facts
    yield f"All numbers were computed with harmolab {version('harmolab')}."
    for row in (*evaluation.systems, RECORDED):
        seeds = f", {counts[row].seeds} seeds" if counts[row].seeds > 1 else ""
        yield (
            f"{row}: {counts[row].text} dances to {counts[row].songs} songs{seeds}, "
            f"{_listed(facts[row]['fps'])} frames per second, {_listed(facts[row]['joints'])} joints."
        )
        if row != RECORDED and (first := evaluation.settings.seed_frames_of(row)):
            yield f"The first {first} frames of each dance of {row}, which the system was given, were left out."
    rows = (*evaluation.systems, RECORDED)
    beats, dances = (sum((facts[row][name] for row in rows), Counter[str]()) for name in ("beats", "dance"))
    yield from _assumptions(evaluation)
    yield from _starts(evaluation)
    yield f"Music beats were annotated for {beats['annotated']} of these dances and tracked for {beats['tracked']}."
    if patterns := {dance: count for dance, count in dances.items() if dance in DANCE_PATTERNS}:
        yield (
            f"Harmony by the bar pattern of the song's dance is that of {_listed(patterns)}; the patterns were learnt "
            "on recorded dancers, and judge those that they were learnt on too kindly."
        )


def _assumptions(evaluation: Evaluation) -> Iterator[Note]:
    """A sentence for each row on what was guessed or assumed when its dances were read; none where nothing was."""
    for row in (*evaluation.systems, RECORDED):
        if dances := _counted(evaluation, row, "assumptions"):
            yield Note(f"Assumptions in reading {row} (dances): {dances}.", row)


def _counted(evaluation: Evaluation, row: str, fact: str) -> str:
    """The texts of a fact of the dances of a row, each with the number of dances that have it; "" without any."""
    return "; ".join(f"{text} ({count})" for text, count in sorted(evaluation.facts[row][fact].items()) if text)


def _listed(values: Mapping[str, int]) -> str:
    """The values of a count, the most frequent first; the numbers beside them where they differ."""
    ordered = sorted(values.items(), key=lambda item: (-item[1], item[0]))
    return ", ".join(f"{value} ({count})" if len(ordered) > 1 else value for value, count in ordered)


def _measurement(evaluation: Evaluation) -> Iterator[str]:
    paper, limits = HarmonyParams.paper(), evaluation.options.limits
    yield (
        "Harmony above chance is the recommended score (the percentile rank of the music beats among all moments of "
        "the movement's shape, expected to rest on the beats, or where it recurs every three beats to move as a waltz "
        "does; 0 is chance, 1 the most there is); a dance in which nothing moves has 0. Harmony h and "
        f"hit rate are in paper mode (reaction delay {paper.reaction_delay:g} s, beta {paper.beta:g}, "
        f"{paper.fps:g} frames per second, thresholds {paper.audio_threshold:g} and {paper.visual_threshold:g}), each "
        "beside what as many visual beats at random moments reach."
    )
    yield (
        "Beat alignment, coverage, hit rate and F-measure take the minima of the smoothed joint speed as motion beats, "
        "with the widths of AIST++ in seconds, between frames, so that they do not change with the frame rate."
    )
    yield (
        "Fréchet distances are from the recorded dances, on kinetic and geometric features (those of AIST++, their "
        f"faults mended) and on the mean features of {PIECE:g} s pieces by a pose network"
        + (f" ({evaluation.options.pose_net.name})" if evaluation.options.pose_net else "")
        + ", in units of the recorded dances; the bias of small samples, estimated from halves of each set as if its "
        "dances were independent, is taken off, and sample sizes stand beside. The "
        "distance of the recorded dances is that between halves of their songs."
    )
    source = "the shipped recordings" if limits is None else f"the recorded dances, {LIMIT_DANCES} of them at most"
    yield f"A dance moves like recorded dancers where thirteen measures lie within the limits of {source}."


def _statistics(evaluation: Evaluation) -> Iterator[str]:
    settings = evaluation.settings
    yield (
        f"Intervals are 95 % by {settings.resamples} resamplings of the songs (seed {settings.seed}), expanded for "
        "small samples (Hesterberg 2015), with dances to one song and seeds averaged within the song. Differences "
        "between systems are paired by song; a rank is given only where the interval of a difference excludes 0 over "
        f"{FEWEST_SONGS} songs or more. The intervals are not corrected for the number of comparisons: of systems that "
        "are equal, one pair in twenty differs by luck, in each measure."
    )
    # The songs of all systems are counted together, so that none needs to have so many itself.
    if any(len(evaluation.songs.loc[row]) < count.songs for row, count in evaluation.counts.items()):
        yield f"Here {MOST_SONGS} groups of songs, drawn by name, stand for the songs, since there are more of them."
    if max(count.dances for count in evaluation.counts.values()) > FEATURE_DANCES:
        yield f"Distances and diversity are of {FEATURE_DANCES} dances of a system at most, drawn by name."


def _protocols(evaluation: Evaluation) -> Iterator[str]:
    for name in evaluation.settings.protocols:
        protocol = protocol_of(name)
        yield f"Columns called {name} follow the published code of that protocol ({protocol.source}):"
        yield " ".join((*protocol.notes, protocol.missing)).strip()
    for row in (*evaluation.systems, RECORDED):
        remarks = {text: count for text, count in evaluation.facts[row]["remarks"].items() if text}
        yield from (f"{row}, {count} dances: {text}" for text, count in remarks.items())


# The table as CSV and JSON

NO_MEAN, NO_NUMBER = Mean(math.nan, math.nan, math.nan, 0), SetNumber(math.nan, 0)
HUGE = 1e6  # from here on a power of ten stands for the digits
# Below so much, so many digits; rounding must not lead over the edge.
_DIGITS = ((0.00005, 2), (0.00995, 4), (0.0995, 3), (9.995, 2), (99.95, 1))


def number_text(value: float) -> str:
    """A number with two digits or three, "-" where there is none; never -0.

    >>> [number_text(value) for value in (0.1234, 0.00123, -0.00001, 12.34, 123.4, 3.4e18, float("nan"))]
    ['0.12', '0.0012', '0.00', '12.3', '123', '3.4e18', '-']
    """
    if not math.isfinite(value):
        return "-"
    if abs(value) >= HUGE:
        return f"{value:.1e}".replace("e+", "e")
    digits = next((digits for most, digits in _DIGITS if abs(value) < most), 0)
    return f"{round(value, digits) + 0.0:.{digits}f}"


def table_records(evaluation: Evaluation) -> list[dict[str, Any]]:
    """A record for each row of the table: counts, then every measure with low, high and rank, then those of sets."""
    records = []
    for name in evaluation.rows:
        record: dict[str, Any] = {"system": name, "control": name in evaluation.controls}
        record |= evaluation.counts[name]._asdict()
        for measure in evaluation.measures:
            mean = evaluation.means.get((name, measure), NO_MEAN)
            record |= {measure: mean.mean, f"{measure}_low": mean.low, f"{measure}_high": mean.high}
            record[f"{measure}_rank"] = evaluation.ranks.get(measure, {}).get(name)
        for measure in evaluation.set_measures:
            number = evaluation.sets.get((name, measure), NO_NUMBER)
            record |= {measure: number.value, f"{measure}_n": number.n}
            if measure.startswith("fid_"):
                record |= {f"{measure}_raw": number.raw, f"{measure}_n_recorded": number.n_recorded}
            if " " in measure:
                record |= {f"{measure}_n_recorded": number.n_recorded, f"{measure}_constant": len(number.constant)}
        records.append(record)
    return records


def table_csv(evaluation: Evaluation) -> str:
    """One line a row of the table; empty where there is no number."""
    frame = pd.DataFrame(table_records(evaluation))
    ranked = [name for name in map(str, frame) if name.endswith("_rank")]
    return str(frame.astype(dict.fromkeys(ranked, "Int64")).to_csv(index=False))


def table_content(evaluation: Evaluation) -> dict[str, Any]:
    """Everything there is to say about the table, for JSON: rows, differences, remarks, methods, what was left out."""
    return {
        "harmolab": version("harmolab"),
        "settings": evaluation.settings.to_dict(),
        "measures": {name: measure_of(name)._asdict() for name in evaluation.measures},
        "rows": table_records(evaluation),
        "differences": [one._asdict() for one in evaluation.differences],
        "facts": {row: {name: dict(values) for name, values in facts.items()}
                  for row, facts in evaluation.facts.items()},
        "notes": list(table_notes(evaluation)),
        "methods": methods_paragraph(evaluation),
        "methods_in_full": full_methods(evaluation),
        "unpaired": [{"file": str(one.file), "reason": one.reason} for one in evaluation.unpaired],
        "errors": [{"file": str(one.file), "reason": one.reason} for one in evaluation.errors],
    }  # fmt: skip
