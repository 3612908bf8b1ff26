"""The claims of "Music2Dance" and what our tables say of them."""

from dataclasses import replace

from study.claims.claim import Claim, Words, spread, value
from study.findings import RunTables

SONGS = "recorded, 4 dances"
OURS, THEIR_BASELINE, LINEAR = "temporal convolution + Bi-LSTM", "FC + Bi-LSTM", "logistic on onset rhythm"
SPEED = "sliding (cm/s)"
CALM_LSTM = "Music2Dance's LSTM, calm"
TENTH = "the whole schedule in place of a tenth, three trainings of each: `make gpu`"
PEOPLE = "25 people; the study's kit is built, its raters here are simulated"


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
        f"poses vary {_part(tables, ablation)} times as much as recorded ones {words}, {_part(tables, 'whole')} with all parts"
    )


def _hands(tables: RunTables) -> str:
    """Variety of the hands' heights with both kinds of features, mean over the dances to the song."""
    curves = tables["m2d_fig08_hands"].query("kind == 'raw'").groupby(["features", "number"])[["hand L", "hand R"]]
    heights = 100 * curves.std(ddof=0).mean(axis=1).groupby("features").mean()
    return (
        f"hands vary in height by {heights['15 channels']:.0f} cm, with a mel spectrogram by "
        f"{heights['mel spectrogram']:.0f}; " + _poses("mel", "with a mel spectrogram")(tables)
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
    return f"toes vary in height by {full[0]} cm with them, {full[1]} without; a tenth of the spread drawn, {calm[0]} and {calm[1]}"


def _losses(tables: RunTables) -> str:
    without, whole = (_part(tables, name, "fixed nats", 1) for name in ("no clusters", "whole"))
    return f"loss on the same windows {whole} nats with clusters, {without} without"


def _ablated(
    place: str, claim: str, ours: Words, notebook: str = "16_music2dance", test: str = "test_music2dance.py"
) -> Claim:
    """A claim about an ablation, which a tenth of the schedule cannot settle."""

    def beside(_: RunTables) -> str:
        return "two trainings, a tenth of the schedule"

    return Claim(place, claim, "one song", ours, beside, "cannot be tested", None, notebook, test, TENTH)


MUSIC2DANCE = (
    Claim(
        "Table 1", "temporal convolution classifies songs better than a fully connected layer", "92.1 against 88.0 % (two moods)",
        lambda tables: f"{_songs(tables, OURS)} against {_songs(tables, THEIR_BASELINE)} % of recorded songs, four dances",
        lambda tables: f"always the most frequent {_songs(tables, 'majority')} %; a linear model of rhythm {_songs(tables, LINEAR)} %",
        "reproduced", lambda tables: _ahead(tables, THEIR_BASELINE, "low") > 0,
        "15_music_and_attributes", "test_attribute_tables.py",
    ),
    Claim(
        "Sec. 5.1", "the classifier is excellent, and needed", "92.1 %",
        lambda tables: f"a linear model of the onsets' rhythm is {-_ahead(tables, LINEAR, 'difference'):.0f} points better on recorded songs",
        lambda tables: f"{_songs(tables, LINEAR, 'balanced')} % balanced, chance 25",
        "refuted", lambda tables: _ahead(tables, LINEAR, "high") < 0, "15_music_and_attributes", "test_attribute_tables.py",
    ),
    Claim(
        "Table 2", "the foot model's error is below an LSTM's", ".0010 against .0028",
        lambda tables: f"{_feet(tables, 'temporal convolution', 'MSE'):.4f} against {_feet(tables, 'FC + LSTM + FC', 'MSE'):.4f} rad²",
        lambda tables: f"highest {_feet(tables, 'temporal convolution', 'MSE, high'):.4f}, lowest {_feet(tables, 'FC + LSTM + FC', 'MSE, low'):.4f}; "
                       f"three trainings; no correction {_feet(tables, 'no correction', 'MSE'):.4f}",
        "reproduced",
        lambda tables: _feet(tables, "temporal convolution", "MSE, high") < _feet(tables, "FC + LSTM + FC", "MSE, low"),
        "17_feet", "test_feet.py",
    ),
    Claim(
        "Sec. 4.5", "the foot model mends sliding feet", "",
        lambda tables: f"recordings made to slide {_feet(tables, 'no correction', SPEED):.1f} cm/s without it, "
                       f"{_feet(tables, 'temporal convolution', SPEED):.1f} [{_feet(tables, 'temporal convolution', f'{SPEED}, low'):.1f}, "
                       f"{_feet(tables, 'temporal convolution', f'{SPEED}, high'):.1f}] with it; dances {_sliding(tables, 'none')} and {_sliding(tables, 'model')}",
        lambda tables: f"feet planted by rules {_feet(tables, 'planted feet, not learnt', SPEED):.1f}; dances {_sliding(tables, 'planted')}",
        "refuted",
        lambda tables: _feet(tables, "temporal convolution", f"{SPEED}, low") > _feet(tables, "no correction", SPEED)
        and _slides(tables, "model") >= _slides(tables, "none"),
        "17_feet", "test_feet.py",
    ),
    Claim(
        "Sec. 4.5", "foot contacts are predicted", "85 to 90 %",
        lambda tables: f"{100 * _contacts(tables, 'predicted'):.0f} %",
        lambda tables: f"as in the frame before {100 * _contacts(tables, 'as in the frame before'):.0f} %, the more frequent "
                       f"{100 * _contacts(tables, 'majority'):.0f} %",
        "not reproduced", lambda tables: _contacts(tables, "predicted") < 0.85, "17_feet", "test_feet.py", TENTH,
    ),
    Claim(
        "Sec. 1, Fig. 7", "dances are natural and rich", "pictures",
        lambda tables: f"as printed {_people(tables, 'Music2Dance')} move like people, by our guard; with our settings {_people(tables, 'Music2Dance, recommended')}",
        lambda tables: f"recorded dancers {_people(tables, 'recorded, right song')}, whom its limits are taken from",
        "not reproduced", lambda tables: _people(tables, "Music2Dance").startswith("0 of"), "16_music2dance", "test_likeness.py", TENTH,
    ),
    Claim(
        "Sec. 1", "dances go with the music", "",
        lambda tables: "as printed, own music is told from other music in {} of {} tests (four dances, two scores)".format(*_hears(tables)),
        lambda tables: "chance bands in `figures/m2d_table_right_music.csv`; one in forty tests is above by luck",
        "not reproduced", lambda tables: _hears(tables)[0] < 0.5 * _hears(tables)[1], "16_music2dance", "test_music2dance_dancing.py", TENTH,
    ),
    Claim(
        "Fig. 6", "people mark the WaveNet's dances above the LSTM's", "bars; 8.5 (modern), 8.2 (curtilage) for its own",
        lambda tables: f"not asked; measures in their place mark it {_mark(tables, 'Music2Dance'):.1f}; a tenth of the spread drawn, "
                       + spread(tables, "m2d_table03_machine", "total", digits=1, system="Music2Dance, calm")
                       + f", the LSTM {_mark(tables, CALM_LSTM):.1f} (one training)",
        lambda tables: f"recorded dancers {_mark(tables, 'recorded, right song'):.0f}, a statue "
                       f"{_mark(tables, 'statue of the recorded'):.0f}, by construction",
        "cannot be tested", None, "16_music2dance", "test_music2dance.py", PEOPLE,
    ),
    _ablated("Fig. 8", "music features make hands move more than a mel spectrogram does", _hands),
    _ablated("Fig. 9", "without the mapping of the music dances are poor", _poses("no mapping", "without it")),
    _ablated("Fig. 10", "end effectors make toes move more", _toes, "17_feet", "test_feet.py"),
    replace(_ablated("Fig. 11", "clusters of windows lower the loss", _losses), paper="by about 3, in training"),
)  # fmt: skip
