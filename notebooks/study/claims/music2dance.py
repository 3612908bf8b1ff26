"""The claims of "Music2Dance" and what our tables say of them."""

from dataclasses import replace

from study.claims.claim import Claim, Words, spread, value
from study.findings import RunTables

SONGS = "recorded, 4 dances"
OURS, THEIR_BASELINE, LINEAR = "temporal convolution + Bi-LSTM", "FC + Bi-LSTM", "logistic on onset rhythm"
SPEED = "sliding (cm/s)"
CALM_LSTM = "Music2Dance's LSTM, calm"
TENTH = "the whole schedule and three trainings of each (`make gpu`)"
PEOPLE = "25 people (the kit of the study is built; its raters here are simulated)"


def _songs(tables: RunTables, model: str, column: str = "songs") -> str:
    return spread(tables, "m2d_table01", column, digits=0, set=SONGS, model=model)


def _ahead(tables: RunTables, against: str, column: str) -> float:
    row = {"set": SONGS, "model": OURS, "against": against, "measure": "songs"}
    return float(value(tables, "m2d_table01b_differences", column, **row))


def _feet(tables: RunTables, feet: str, column: str) -> float:
    return float(value(tables, "m2d_table02", column, corpus="beatlocked", code="rotations", feet=feet))


def _sliding(tables: RunTables, feet: str) -> str:
    return spread(tables, "m2d_table02b_dances", SPEED, digits=0, dancer="recommended", feet=feet)


def _slides(tables: RunTables, feet: str) -> float:
    return float(value(tables, "m2d_table02b_dances", SPEED, dancer="recommended", feet=feet))


def _people(tables: RunTables, system: str) -> str:
    share, dances = (
        value(tables, "m2d_table_likeness", name, system=system, dance="all")
        for name in ("moves like people", "dances")
    )
    return f"{share * dances:.0f} of {dances}"


def _mark(tables: RunTables, system: str) -> float:
    return float(value(tables, "m2d_table03_machine", "total", system=system))


def _contacts(tables: RunTables, column: str) -> float:
    return float(value(tables, "m2d_table02c_contacts", column, dancer="paper"))


def _hears(tables: RunTables) -> tuple[int, int]:
    """Tests, by dance and score, in which the printed network's own music is above chance; and their number."""
    table = tables["m2d_table_right_music"]
    rows = table[(table["system"] == "Music2Dance") & table["auc"].notna()]
    return int((rows["verdict"] == "above").sum()), len(rows)


def _part(tables: RunTables, ablation: str, measure: str = "pose variance", digits: int = 2) -> str:
    return spread(tables, "m2d_table_ablations", digits=digits, ablation=ablation, measure=measure)


def _poses(ablation: str, words: str) -> Words:
    """Variety of the poses with a part less, beside all parts."""
    return lambda tables: (
        f"variety of the poses, as a multiple of the recorded: {words} {_part(tables, ablation)}, with all parts {_part(tables, 'whole')}"
    )


def _hands(tables: RunTables) -> str:
    """Variety of the hands' heights with both kinds of features, mean over the dances to the song."""
    curves = tables["m2d_fig08_hands"].query("kind == 'raw'").groupby(["features", "number"])[["hand L", "hand R"]]
    heights = 100 * curves.std(ddof=0).mean(axis=1).groupby("features").mean()
    return (
        f"heights of the hands vary by {heights['15 channels']:.0f} cm with music features, by {heights['mel spectrogram']:.0f} cm "
        "with a mel spectrogram; " + _poses("mel", "with a mel spectrogram")(tables)
    )


def _toes(tables: RunTables) -> str:
    """Variety of the toes' heights with and without end effectors, at both drawings."""
    full, calm = (
        [
            spread(tables, "m2d_table10_variety", "SD (cm)", digits=1, drawing=drawing, dancer=f"{name} end effectors")
            for name in ("with", "without")
        ]
        for drawing in ("all of the spread", "a tenth of the spread")
    )
    return f"heights of the toes vary by {full[0]} cm with end effectors, {full[1]} without; with a tenth of the spread {calm[0]} and {calm[1]}"


def _losses(tables: RunTables) -> str:
    without, whole = (_part(tables, name, "fixed nats", 1) for name in ("no clusters", "whole"))
    return f"loss on the same windows: {whole} nats with clusters, {without} without"


def _ablated(
    place: str, claim: str, ours: Words, notebook: str = "16_music2dance", test: str = "test_music2dance.py"
) -> Claim:
    """A claim about an ablation, which a tenth of the schedule cannot settle."""

    def beside(_: RunTables) -> str:
        return "two trainings of each, a tenth of the schedule"

    return Claim(place, claim, "one song", ours, beside, "cannot be tested", None, notebook, test, TENTH)


MUSIC2DANCE = (
    Claim(
        "Table 1", "temporal convolution classifies songs better than a fully connected layer", "92.1 against 88.0 % (two moods)",
        lambda tables: f"{_songs(tables, OURS)} against {_songs(tables, THEIR_BASELINE)} % of recorded songs (four dances)",
        lambda tables: f"always the most frequent dance {_songs(tables, 'majority')} %, a linear model of rhythm {_songs(tables, LINEAR)} %",
        "reproduced", lambda tables: _ahead(tables, THEIR_BASELINE, "low") > 0,
        "15_music_and_attributes", "test_attribute_tables.py",
    ),
    Claim(
        "Sec. 5.1", "the classifier is excellent, and needed", "92.1 %",
        lambda tables: f"a linear model of rhythm is {-_ahead(tables, LINEAR, 'difference'):.0f} points better on recorded songs",
        lambda tables: f"every dance counting alike, that model has {_songs(tables, LINEAR, 'balanced')} %, guessing 25",
        "refuted", lambda tables: _ahead(tables, LINEAR, "high") < 0, "15_music_and_attributes", "test_attribute_tables.py",
    ),
    Claim(
        "Table 2", "the foot model has a smaller error than an LSTM", ".0010 against .0028",
        lambda tables: f"{_feet(tables, 'temporal convolution', 'MSE'):.4f} against {_feet(tables, 'FC + LSTM + FC', 'MSE'):.4f} rad²",
        lambda tables: f"by the intervals over three trainings {_feet(tables, 'temporal convolution', 'MSE, high'):.4f} at most against "
                       f"{_feet(tables, 'FC + LSTM + FC', 'MSE, low'):.4f} at least; with no correction {_feet(tables, 'no correction', 'MSE'):.4f}",
        "reproduced",
        lambda tables: _feet(tables, "temporal convolution", "MSE, high") < _feet(tables, "FC + LSTM + FC", "MSE, low"),
        "17_feet", "test_feet.py",
    ),
    Claim(
        "Sec. 4.5", "the foot model mends sliding feet", "",
        lambda tables: f"in recordings that were made to slide, standing feet slide {_feet(tables, 'no correction', SPEED):.1f} cm/s without it, "
                       f"{_feet(tables, 'temporal convolution', SPEED):.1f} [{_feet(tables, 'temporal convolution', f'{SPEED}, low'):.1f}, "
                       f"{_feet(tables, 'temporal convolution', f'{SPEED}, high'):.1f}] with it; in generated dances {_sliding(tables, 'none')} without, {_sliding(tables, 'model')} with it",
        lambda tables: f"feet planted by rules: {_feet(tables, 'planted feet, not learnt', SPEED):.1f} cm/s; in generated dances {_sliding(tables, 'planted')}",
        "refuted",
        lambda tables: _feet(tables, "temporal convolution", f"{SPEED}, low") > _feet(tables, "no correction", SPEED)
        and _slides(tables, "model") >= _slides(tables, "none"),
        "17_feet", "test_feet.py",
    ),
    Claim(
        "Sec. 4.5", "foot contacts are predicted", "85 to 90 %",
        lambda tables: f"{100 * _contacts(tables, 'predicted'):.0f} % are right",
        lambda tables: f"to say \"as in the frame before\" {100 * _contacts(tables, 'as in the frame before'):.0f} %, always the more "
                       f"frequent answer {100 * _contacts(tables, 'majority'):.0f} %",
        "not reproduced", lambda tables: _contacts(tables, "predicted") < 0.85, "17_feet", "test_feet.py", TENTH,
    ),
    Claim(
        "Sec. 1, Fig. 7", "the dances are natural and rich", "pictures",
        lambda tables: f"as printed {_people(tables, 'Music2Dance')} dances pass the guard; with our settings {_people(tables, 'Music2Dance, recommended')}",
        lambda tables: f"recorded dancers {_people(tables, 'recorded, right song')} (they set its limits)",
        "not reproduced", lambda tables: _people(tables, "Music2Dance").startswith("0 of"), "16_music2dance", "test_likeness.py", TENTH,
    ),
    Claim(
        "Sec. 1", "the dances go with the music", "",
        lambda tables: "as printed, a dance's own music is told from other music in {} of {} tests (four dances, two scores)".format(*_hears(tables)),
        lambda tables: "by luck one test in forty does; chance bands are in `figures/m2d_table_right_music.csv`",
        "not reproduced", lambda tables: _hears(tables)[0] < 0.5 * _hears(tables)[1], "16_music2dance", "test_music2dance_dancing.py", TENTH,
    ),
    Claim(
        "Fig. 6", "people give the WaveNet's dances higher marks than the LSTM's", "bars; the WaveNet's 8.5 (modern) and 8.2 (curtilage)",
        lambda tables: f"no person was asked; marks of measures, out of ten: the WaveNet {_mark(tables, 'Music2Dance'):.1f}; with a tenth of the spread "
                       + spread(tables, "m2d_table03_machine", "total", digits=1, system="Music2Dance, calm")
                       + f", and the LSTM {_mark(tables, CALM_LSTM):.1f} (one training)",
        lambda tables: f"by construction recorded dancers {_mark(tables, 'recorded, right song'):.0f}, a frozen pose "
                       f"{_mark(tables, 'statue of the recorded'):.0f}",
        "cannot be tested", None, "16_music2dance", "test_music2dance.py", PEOPLE,
    ),
    _ablated("Fig. 8", "with music features hands move more than with a mel spectrogram", _hands),
    _ablated("Fig. 9", "without the mapping of the music the dances are poor", _poses("no mapping", "without it")),
    _ablated("Fig. 10", "with end effectors toes move more", _toes, "17_feet", "test_feet.py"),
    replace(_ablated("Fig. 11", "clusters of windows lower the loss", _losses), paper="by about 3, in training"),
)  # fmt: skip
