"""The claims of "Harmony-aware Human Motion Synthesis with Music" and what our tables say of them."""

from typing import Any

from study.claims.claim import Claim, spread, value
from study.findings import RunTables

CORPUS = "beatlocked"
CORPORA = (CORPUS, "synthetic")
PEOPLE = "ten people and an afternoon (`harmolab data study` is the kit)"
GPU = "full-size networks (`make gpu`), and recorded songs of all dances"
AUC = "table08b_auc"
GAINS: dict[str, Any] = {"corpus": CORPUS, "loss": "paper"}
RECORDED, SYNTHETIC = "recorded songs", "synthetic songs"
SYSTEMS = "table12_systems"
H_ALONE = "paper's h (machine)"


def _system(tables: RunTables, column: str, system: str, music: str) -> float:
    return float(value(tables, SYSTEMS, column, music=music, corpus=CORPUS, system=system))


def _guard(tables: RunTables, system: str, music: str) -> str:
    """Dances of a system that pass the guard, as "3 of 18"."""
    return str(value(tables, SYSTEMS, "guard", music=music, corpus=CORPUS, system=system))


def _both(tables: RunTables, column: str, *systems: str) -> str:
    """A number of some systems, to synthetic songs and to recorded ones."""
    return "; ".join(
        f"{music}: " + ", ".join(f"{system} {_system(tables, column, system, music):.3f}" for system in systems)
        for music in (SYNTHETIC, RECORDED)
    )


def _ratio(tables: RunTables, column: str, music: str) -> float:
    return _system(tables, column, "HarmoGAN", music) / _system(tables, column, "Ren et al. 2020", music)


def _box(tables: RunTables, column: str) -> float:
    """A count over the walks, as a share of the beats without the box."""
    table = tables["table02_box"]
    return float(table[column].sum() / table["without box"].sum())


def _beats(tables: RunTables, column: str, detector: str) -> float:
    return float(value(tables, "table05_omission_redundancy", column, detector=detector, **{"tolerance (s)": 0.12}))


def _variant(tables: RunTables, column: str, variant: str, measure: str, corpus: str = CORPUS) -> float:
    return float(value(tables, "table11_ablation", column, corpus=corpus, variant=variant, measure=measure))


def _inside(tables: RunTables, corpus: str) -> bool:
    """The AUC of the paper's h lies inside its chance band."""
    low, auc, high = (
        value(tables, AUC, name, corpus=corpus, score="paper") for name in ("chance low", "AUC", "chance high")
    )
    return bool(low <= auc <= high)


def _auc(tables: RunTables, corpus: str) -> str:
    return spread(tables, AUC, "AUC", corpus=corpus, score="paper")


def _band(tables: RunTables, corpus: str) -> str:
    row = {"corpus": corpus, "score": "paper"}
    return f"{value(tables, AUC, 'chance low', **row):.2f} to {value(tables, AUC, 'chance high', **row):.2f}"


def _readings(tables: RunTables) -> str:
    table = tables["table08j_readings"]
    return (
        f"{table['AUC'].min():.2f} to {table['AUC'].max():.2f} of the clips, depending on the reading; "
        f"mean h {table['h'].min():.2f} to {table['h'].max():.2f}"
    )


def _reading(tables: RunTables, column: str) -> float:
    return float(value(tables, "table08j_readings", column, reading="as it is"))


def _trick(tables: RunTables, column: str) -> float:
    return float(value(tables, "table_cheating_gains", column, corpus=CORPUS, trick="too slow + jitter 5 mm"))


HARMONY = (
    Claim(
        "Fig. 2", "when something else moves in the picture, optical flow loses the dancer's beats", "one picture",
        lambda tables: f"when a box walks through the film, optical flow finds {_box(tables, 'found again'):.2f} of its beats again (one clip, five walks)",
        lambda tables: f"by chance {_box(tables, 'found by chance'):.2f}",
        "reproduced", lambda tables: _box(tables, "found again") < 0.5 * (1 + _box(tables, "found by chance")),
        "02_flow_or_skeleton", "test_walks.py",
    ),
    Claim(
        "Fig. 3", "many changes of direction are left over: no beat of the music is their partner", "one clip, by eye",
        lambda tables: f"{_beats(tables, 'redundant', 'direction'):.0f} of {_beats(tables, 'visual beats', 'direction'):.0f} changes of direction are left over",
        lambda tables: f"of turns of the joint speed {_beats(tables, 'redundant', 'turns'):.0f} of {_beats(tables, 'visual beats', 'turns'):.0f}",
        "reproduced",
        lambda tables: 2 * _beats(tables, "redundant", "direction") > _beats(tables, "visual beats", "direction"),
        "01_harmony_distortion", "test_experiments.py",
    ),
    Claim(
        "Fig. 5", "turns of the joint speed meet the music's beats better than changes of direction do", "one clip, by eye",
        lambda tables: f"of {_beats(tables, 'music beats', 'turns'):.0f} music beats turns meet {_beats(tables, 'hit rate', 'turns'):.3f}, "
                       f"changes of direction {_beats(tables, 'hit rate', 'direction'):.3f}",
        lambda tables: f"by chance: turns {_beats(tables, 'chance', 'turns'):.3f}, changes of direction {_beats(tables, 'chance', 'direction'):.3f}",
        "refuted",
        lambda tables: _beats(tables, "omitted", "turns") > _beats(tables, "omitted", "direction")
        and _beats(tables, "hit rate", "turns") < _beats(tables, "chance", "turns") + 0.02,
        "03_beats_from_joint_speed", "test_experiments.py",
    ),
    Claim(
        "Fig. 8, Sec. 5.6", "h follows what people perceive: it tells a dance's own music from wrong music", "",
        lambda tables: f"AUC of own against late music: beat-locked recordings {_auc(tables, CORPUS)}, recordings of Tang et al. {_auc(tables, 'tang2018')}",
        lambda tables: f"by chance: beat-locked recordings {_band(tables, CORPUS)}, recordings of Tang et al. {_band(tables, 'tang2018')}",
        "refuted", lambda tables: _inside(tables, CORPUS) and _inside(tables, "tang2018"),
        "05_right_from_wrong", "test_compare.py",
    ),
    Claim(
        "Fig. 8", "the same, in each reading that the paper leaves open", "",
        lambda tables: f"recordings of Tang et al.: h is larger with own than with late music in {_readings(tables)}",
        lambda tables: "a coin .5; intervals are in `figures/table08j_readings.csv`",
        "refuted", lambda tables: bool((tables["table08j_readings"]["AUC low"] <= 0.5).all()),
        "05_right_from_wrong", "test_notebook_05.py",
    ),
    Claim(
        "Fig. 8", "people pick out the videos with wrong music", ".78",
        lambda tables: f"no person was asked; h in their place picks {spread(tables, 'table08h_picked_clips', 'harmolab', judge=H_ALONE)} of the ten wrong clips",
        lambda tables: "by guessing .50", "cannot be tested", None, "14_listening_study", "test_listening.py", PEOPLE,
    ),
    Claim(
        "Fig. 11", "the recorded dancer hits half of the music's beats", "about .5",
        lambda tables: f"recordings of Tang et al.: hit rate {_reading(tables, 'hit rate'):.2f}",
        lambda tables: f"by chance {_reading(tables, 'chance'):.2f}",
        "reproduced", lambda tables: 0.4 <= _reading(tables, "hit rate") <= 0.6, "05_right_from_wrong", "test_notebook_05.py",
    ),
    Claim(
        "Fig. 11(a)", "the harmony loss raises h", "bars; by the means of Table 1 from .20 to .35",
        lambda tables: f"from {_variant(tables, 'mean', 'paper, without', 'paper_harmony'):.2f} to "
                       f"{_variant(tables, 'mean', 'paper', 'paper_harmony'):.2f}, a gain of "
                       + spread(tables, "table11b_gains", "change", measure="paper_harmony", **GAINS),
        lambda tables: "no gain is 0; three trainings with the loss, three without",
        "reproduced", lambda tables: value(tables, "table11b_gains", "low", measure="paper_harmony", **GAINS) > 0,
        "09_harmony_loss", "test_harmogan_terms.py",
    ),
    Claim(
        "Fig. 11(b)", "the harmony loss raises the hit rate", "bars; by the means of Table 2 from .24 to .76",
        lambda tables: f"a gain of {spread(tables, 'table11b_gains', 'change', measure='paper_hit_rate', **GAINS)}",
        lambda tables: f"the hit rate by chance rises too, from {_variant(tables, 'mean', 'paper, without', 'paper_chance'):.2f} to "
                       f"{_variant(tables, 'mean', 'paper', 'paper_chance'):.2f}",
        "reproduced", lambda tables: value(tables, "table11b_gains", "low", measure="paper_hit_rate", **GAINS) > 0,
        "09_harmony_loss", "test_harmogan_terms.py",
    ),
    Claim(
        "Fig. 11", "what the loss gains is harmony: more beats are met than by chance", "",
        lambda tables: f"harmony above chance changes by {spread(tables, 'table11b_gains', 'change', measure='above_chance', **GAINS)}; "
                       f"on synthetic songs by {spread(tables, 'table11b_gains', 'change', measure='above_chance', loss='paper', corpus='synthetic')}",
        lambda tables: "no gain is 0; on synthetic songs a frozen pose on the same path goes from {:.2f} to {:.2f}".format(
            *(_variant(tables, "mean", name, "statue_above_chance", "synthetic") for name in ("paper, without", "paper"))),
        "not reproduced",
        lambda tables: value(tables, "table11b_gains", "low", measure="above_chance", **GAINS) <= 0, "09_harmony_loss",
        "test_harmogan_terms.py",
    ),
    Claim(
        "Fig. 11, Sec. 5.5.1", "with the loss, h is larger than the real dancer's", "\"significantly\"",
        lambda tables: "h with the loss: recordings {} (the dancers {:.3f}), synthetic songs {} ({:.3f})".format(
            *(number for corpus in CORPORA for number in (
                spread(tables, "table11_ablation", corpus=corpus, variant="paper", measure="paper_harmony", digits=3),
                _variant(tables, "mean", "recorded", "paper_harmony", corpus)))),
        lambda tables: "the verdict is of recordings; the hit rate by chance, with the loss and of the dancers: "
                       f"{_variant(tables, 'mean', 'paper', 'paper_chance'):.2f} and {_variant(tables, 'mean', 'recorded', 'paper_chance'):.2f}",
        "reproduced",
        lambda tables: _variant(tables, "low", "paper", "paper_harmony") > _variant(tables, "mean", "recorded", "paper_harmony"),
        "09_harmony_loss", "test_harmogan_terms.py",
    ),
    Claim(
        "abstract, Table 1", "HarmoGAN has around 20 % more h than other systems", ".352; Lee et al. .295, Ren et al. .263",
        lambda tables: _both(tables, "h", "HarmoGAN", "Ren et al. 2020"),
        lambda tables: "by chance, " + _both(tables, "h chance", "HarmoGAN", "Ren et al. 2020"),
        "not reproduced", lambda tables: all(_ratio(tables, "h", music) < 1.2 for music in (SYNTHETIC, RECORDED)),
        "10_systems_compared", "test_comparison.py", GPU,
    ),
    Claim(
        "Table 2", "HarmoGAN has a higher hit rate than other systems", ".757; Lee et al. .591, Ren et al. .426",
        lambda tables: _both(tables, "hit_rate", "HarmoGAN", "Ren et al. 2020"),
        lambda tables: "by chance, " + _both(tables, "hit_rate chance", "HarmoGAN", "Ren et al. 2020"),
        "not reproduced", lambda tables: all(_ratio(tables, "hit_rate", music) < 1 for music in (SYNTHETIC, RECORDED)),
        "10_systems_compared", "test_comparison.py", GPU,
    ),
    Claim(
        "Tables 1, 2", "HarmoGAN has more h than Lee et al. 2019", ".352; Lee et al. .295",
        lambda tables: f"our Lee et al. passes {value(tables, SYSTEMS, 'entry tests', music=SYNTHETIC, corpus=CORPUS, system='Lee et al. 2019')} "
                       "entry tests, which ask whether its training worked; it gets no number",
        lambda tables: "", "cannot be tested", None, "10_systems_compared", "test_lee2019.py",
        "more recordings than our 296 sequences, and three full trainings (`make gpu`)",
    ),
    Claim(
        "Tables 1, 2", "without the harmony loss HarmoGAN is the last of all systems", "h .199, hit rate .240",
        lambda tables: "h " + "; ".join(
            f"{music}: " + spread(tables, SYSTEMS, "h", music=music, corpus=CORPUS, system="HarmoGAN without L_harmo") + " without, "
            + spread(tables, SYSTEMS, "h", music=music, corpus=CORPUS, system="HarmoGAN") + " with" for music in (SYNTHETIC, RECORDED)),
        lambda tables: "by chance, " + _both(tables, "h chance", "HarmoGAN without L_harmo", "HarmoGAN"),
        "not reproduced",
        lambda tables: _system(tables, "h", "HarmoGAN without L_harmo", SYNTHETIC) > 0.9 * _system(tables, "h", "HarmoGAN", SYNTHETIC),
        "10_systems_compared", "test_comparison.py", GPU,
    ),
    Claim(
        "abstract, Fig. 10", "HarmoGAN's motion is of high perceptual quality", "one example",
        lambda tables: f"{_guard(tables, 'HarmoGAN', RECORDED)} dances with the paper's loss, to recorded songs, pass the guard",
        lambda tables: f"recorded dancers {_guard(tables, 'recorded, right song', RECORDED)} (they set its limits)",
        "not reproduced", lambda tables: _guard(tables, "HarmoGAN", RECORDED).startswith("0 of"), "10_systems_compared",
        "test_likeness.py", GPU,
    ),
    Claim(
        "Fig. 9", "HarmoGAN's Fréchet distances compete with those of Lee et al. and Ren et al.", "a bar chart",
        lambda tables: f"by our pose network {_variant(tables, 'mean', 'paper', 'fid'):.0f} with the loss, {_variant(tables, 'mean', 'paper, without', 'fid'):.0f} without",
        lambda tables: "none: distances in other features cannot be compared", "cannot be tested", None, "08_motion_quality",
        "test_motion_quality.py", "the paper's features (it publishes no network, and takes the others' numbers from their papers)",
    ),
    Claim(
        "Fig. 13", "people prefer HarmoGAN's dances", "a bar chart, 12 people",
        lambda tables: "no person was asked; in notebook 11 scores vote in their place", lambda tables: "by guessing .50",
        "cannot be tested", None, "11_frame_by_frame", "test_listening_presenting.py", PEOPLE,
    ),
    Claim(
        "Sec. 5.2, 5.5.2", "HarmoGAN is trained in 53 minutes, with half the parameters of Lee et al. and a tenth of its data", "53 minutes",
        lambda tables: f"small preset: {_system(tables, 'parameters (M)', 'HarmoGAN', SYNTHETIC):.1f} M parameters, "
                       f"{_system(tables, 'training minutes', 'HarmoGAN', SYNTHETIC):.0f} minutes; the full size (7.3 M) is not in our tables",
        lambda tables: "", "cannot be tested", None, "10_systems_compared", "test_harmogan_networks.py", "an hour on a GPU (`make gpu`)",
    ),
    Claim(
        "Sec. 6", "visual beats that come too often fool the measure", "named as a limit",
        lambda tables: f"joints that tremble by 5 mm, in a dance three times too slow: h {_trick(tables, 'paper_harmony'):+.2f}, hit rate "
                       f"{_trick(tables, 'paper_hit_rate'):+.2f}",
        lambda tables: f"harmony above chance {_trick(tables, 'above_chance'):+.2f}",
        "reproduced", lambda tables: _trick(tables, "paper_hit_rate") > 0.1, "12_cheating_the_score", "test_cheating.py",
    ),
)  # fmt: skip
