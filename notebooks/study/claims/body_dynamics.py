"""The claims of "Audio to Body Dynamics" and what our tables say of them."""

from scipy.stats import kendalltau

from study.claims.claim import Claim, spread, value
from study.findings import RunTables

FILES = {"violin": "a2b_table01_violin", "piano": "a2b_table02_piano"}
DIRTY, HALF = "frames not dropped", "50 % of the training data"
RANDOM = "random features"
OTHER, PLACE, RIDGE = "sound of another piece", "mean place of each hand", "ridge regression"
LUCK = "most rows differ by no more than trainings of one row do; in earlier runs the piano's order agreed once, and the violin's once"
PEOPLE = "people who judge (the page that shows it is built)"


def _error(tables: RunTables, instrument: str, row: str, column: str = "test full") -> float:
    return float(value(tables, FILES[instrument], column, row=row))


def _pair(tables: RunTables, row: str) -> str:
    """Errors of a row of both planted players, their SD over trainings beside them."""
    each = (
        f"{name} {_error(tables, name, row):.1f} ± {_error(tables, name, row, 'test full SD'):.1f}"
        for name in ("violin", "piano")
    )
    return ", ".join(each)


def _costs(tables: RunTables, instrument: str, row: str) -> float:
    """By how many SDs over trainings a row's error lies above that of the final settings."""
    spreads = (_error(tables, instrument, name, "test full SD") for name in (row, "final"))
    return (_error(tables, instrument, row) - _error(tables, instrument, "final")) / max(1e-9, sum(spreads))


def _hands(tables: RunTables, row: str) -> float:
    """Error of real hands as a share of the mean pose's."""
    return float(value(tables, "a2b_hands", "of mean pose", row=row))


def _real(tables: RunTables, row: str) -> str:
    """A row beside the final settings on real hands, one training each."""
    return f"real hands: {_hands(tables, row):.2f} of the mean pose's error, with the final settings {_hands(tables, 'final'):.2f} (one training each)"


def _controls(tables: RunTables) -> str:
    return ", ".join(f"{row} {_hands(tables, row):.2f}" for row in (OTHER, PLACE, RIDGE))


def _tau(tables: RunTables, instrument: str, column: str) -> float:
    return float(value(tables, "a2b_rank_agreement", column, instrument=instrument))


def _order(tables: RunTables, instrument: str) -> str:
    return f"Kendall's tau {spread(tables, 'a2b_rank_agreement', 'tau', instrument=instrument)}"


def _no_agreement(tables: RunTables, instrument: str) -> str:
    return f"p = {_tau(tables, instrument, 'p'):.2f}; without bad frames and half of the data tau {rest_of_order(tables, instrument)}"


def rest_of_order(tables: RunTables, instrument: str) -> str:
    """Agreement of the paper's rows without the two that have a claim of their own, as each is far worse than all others."""
    rows = tables[FILES[instrument]].dropna(subset="paper test")
    rows = rows[~rows["row"].isin([DIRTY, HALF])]
    tau, p = kendalltau(rows["paper test"], rows["test projected"])
    return f"{tau:.2f}, p = {p:.2f}"


def _noise(tables: RunTables, instrument: str, sound: str = "white noise as sound") -> float:
    return float(value(tables, "a2b_fig06_random", "SD 1 / music", instrument=instrument, input=sound))


def _hits(tables: RunTables, column: str, hands: str) -> float:
    return float(value(tables, "a2b_hits_piano", column, hands=hands))


BODY_DYNAMICS = (
    Claim(
        "abstract", "movement of the body can be predicted from sound", "violin 8.3, piano 6.8 pixels; nothing beside them",
        lambda tables: f"planted players: {_pair(tables, 'final')} pixels",
        lambda tables: f"mean pose: violin {_error(tables, 'violin', 'mean pose'):.1f}, piano {_error(tables, 'piano', 'mean pose'):.1f}; "
                       f"sound of another piece: {_pair(tables, 'sound of another piece')}",
        "reproduced",
        lambda tables: all(_error(tables, name, "final") < 0.9 * _error(tables, name, "sound of another piece") for name in FILES),
        "19_sound_to_hands", "test_players.py",
    ),
    Claim(
        "abstract", "the same for real hands (sound rendered from their notes), with the paper's settings", "",
        lambda tables: f"{_hands(tables, 'final'):.2f} of the mean pose's error", _controls,
        "not reproduced", lambda tables: _hands(tables, "final") > _hands(tables, PLACE), "19_sound_to_hands", "test_players.py",
        "recordings with their own sound (with our settings: next row)",
    ),
    Claim(
        "abstract", "the same for real hands, with our settings (tones heard, longer delay, small batches)", "",
        lambda tables: f"{_hands(tables, 'recommended (ours)'):.2f} of the mean pose's error", _controls,
        "reproduced",
        lambda tables: _hands(tables, "recommended (ours)") < min(_hands(tables, RIDGE), _hands(tables, PLACE))
        and _hands(tables, OTHER) > 1,
        "19_sound_to_hands", "test_players.py",
    ),
    Claim(
        "Tables 1, 2", "bad frames must be dropped from training", "kept: violin 18.3, piano 9.5; dropped: 8.3, 6.8",
        lambda tables: f"kept: {_pair(tables, DIRTY)}", lambda tables: f"dropped: {_pair(tables, 'final')}",
        "reproduced", lambda tables: all(_costs(tables, name, DIRTY) > 2 for name in FILES),
        "19_sound_to_hands", "test_audio2body.py",
    ),
    Claim(
        "Tables 1, 2", "a time delay helps", "without: violin 9.2, piano 7.5; with it: 8.3, 6.8",
        lambda tables: f"without: {_pair(tables, 'no delay')}",
        lambda tables: f"with it: {_pair(tables, 'final')}; {_real(tables, 'no delay')}",
        "not reproduced", lambda tables: not all(_costs(tables, name, "no delay") > 2 for name in FILES),
        "19_sound_to_hands", "test_players.py", "hands that move earlier before their notes than planted ones do (real hands gain by our longer delay, not by the paper's: notebook 19)",
    ),
    Claim(
        "Tables 1, 2", "half of the data is worse", "half: violin 9.4, piano 8.9; all: 8.3, 6.8",
        lambda tables: f"half: {_pair(tables, HALF)}", lambda tables: f"all: {_pair(tables, 'final')}; {_real(tables, HALF)}",
        "reproduced", lambda tables: all(_costs(tables, name, HALF) > 2 for name in FILES),
        "19_sound_to_hands", "test_players.py",
    ),
    Claim(
        "Table 2", "the order of the piano's settings", "eleven rows",
        lambda tables: _order(tables, "piano"), lambda tables: _no_agreement(tables, "piano"),
        "not reproduced", lambda tables: _tau(tables, "piano", "p") > 0.05, "19_sound_to_hands", "test_players.py",
        f"more trainings ({LUCK})",
    ),
    Claim(
        "Table 1", "the order of the violin's settings", "twelve rows",
        lambda tables: _order(tables, "violin"), lambda tables: _no_agreement(tables, "violin"),
        "not reproduced", lambda tables: _tau(tables, "violin", "p") > 0.05, "19_sound_to_hands", "test_players.py",
        f"more trainings ({LUCK})",
    ),
    Claim(
        "Fig. 6", "to a random sequence nothing moves", "one picture",
        lambda tables: f"movement of the first component to white noise, as a share of that to music: violin {_noise(tables, 'violin'):.2f}, piano {_noise(tables, 'piano'):.2f}",
        lambda tables: f"to random features: violin {_noise(tables, 'violin', RANDOM):.2f}, piano {_noise(tables, 'piano', RANDOM):.2f}",
        "reproduced",
        lambda tables: all(_noise(tables, name) < 0.2 for name in FILES), "19_sound_to_hands", "test_players.py",
    ),
    Claim(
        "video", "the wrong music looks wrong", "a video",
        lambda tables: f"no person was asked; a pianist who was trained on the sound of other pieces has hits {_hits(tables, 'hits', 'sound of another piece'):.2f} above chance, "
                       f"with {_hits(tables, 'events', 'sound of another piece'):.1f} strikes for each onset",
        lambda tables: f"trained on its own sound: hits {_hits(tables, 'hits', 'final'):.2f}",
        "cannot be tested", None, "20_players_and_avatars", "test_perform.py", PEOPLE,
    ),
)  # fmt: skip
