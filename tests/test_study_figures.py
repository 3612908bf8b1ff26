"""Figures of the study: what stands where on the axes, that titles follow the numbers, drawing again from tables."""

import json
import re
import shutil
from dataclasses import replace
from fnmatch import fnmatchcase
from itertools import combinations, product
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib import ft2font
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.offsetbox import AnnotationBbox
from matplotlib.patches import Patch
from matplotlib.text import Text

from harmolab.body.skeletons import Skeleton
from harmolab.lab.figures.style import COLOURS, styled_axes
from harmolab.lab.report import MANIFEST
from harmolab.systems.harmogan.params import TrainParams
from harmolab.types import Motion
from study.cells import notebook_cells
from study.figures import framework, redraw, variants
from study.figures.framework import framework_figure
from study.figures.pictures import PICTURES
from study.figures.variants import LOOKS
from study.findings import RunTables, headline
from study.profile import RunProfile
from study.saving import PAGE_WIDTH, save_figure, save_table, smallest_text
from tests.builders import cases, refused

NAN = float("nan")
TRAINING, QUALITY = notebook_cells("07_anatomy_and_training"), notebook_cells("08_motion_quality")


ABOUT = {"notebook": "00_start_here", "source": "made up", "profile": RunProfile.quick()}


@pytest.fixture
def ax() -> Axes:
    """Axes that a notebook might draw on."""
    return Figure(figsize=(8, 4)).subplots()


@pytest.fixture
def saving(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder in which figures and tables are saved."""
    monkeypatch.setenv("HARMOLAB_FIGURES", str(tmp_path))
    return tmp_path


def record(variant: str, measure: str, mean: float, low: float = NAN, high: float = NAN, corpus: str = "made up"):
    about = {"corpus": corpus, "variant": variant, "measure": measure, "seeds": 3}
    return about | {"mean": mean, "low": low, "high": high}


def of_all(measure: str, means: list[float], corpus: str = "made up") -> pd.DataFrame:
    """A row for each variant in the order of `LOOKS`, the recorded motion last."""
    return pd.DataFrame([record(name, measure, mean, corpus=corpus) for name, mean in zip(LOOKS, means, strict=True)])


def both_measures(*corpora: str) -> pd.DataFrame:
    above, fid, jerk = [0.1, 0.2, 0.3, 0.9, 0.4], [9.0, 8.0, 7.0, 6.0, NAN], [1.0, 2.0, 3.0, 4.0, 5.0]
    means = {"above_chance": above, "fid": fid, "jerk": jerk}
    return pd.concat(of_all(measure, values, corpus) for corpus in corpora for measure, values in means.items())


def gain(loss: str, measure: str, change: float, half: float, corpus: str = "made up") -> dict[str, object]:
    ends = {"low": change - half, "high": change + half}
    return {"corpus": corpus, "loss": loss, "measure": measure, "change": change, **ends}


def texts(ax: Axes) -> list[str]:
    return [text.get_text() for text in ax.texts]


def titles(figure: Figure, side: str = "left") -> list[str]:
    return [ax.get_title(loc=side).strip() for ax in figure.axes]


def spans(ax: Axes, gid: str = "interval") -> list[list[float]]:
    """From where to where the lines of a kind go."""
    return [list(line.get_xdata()) for line in ax.lines if line.get_gid() == gid]


# One measure (Fig. 11)


@cases(
    "paper, ours, finding",
    (gain("paper", "fid", 1.0, 2.0), gain("recommended", "fid", 3.0, 1.0), "only our harmony term raises it"),
    (gain("paper", "fid", -3.0, 1.0), gain("recommended", "fid", 1.0, 2.0), "only the paper's harmony term lowers it"),
    (gain("paper", "fid", 3.0, 1.0), gain("recommended", "fid", 3.0, 1.0), "both harmony terms raise it"),
    (gain("paper", "fid", 1.0, 2.0), gain("recommended", "fid", -1.0, 2.0), "neither clearly changes it"),
)
def test_title_says_whose_change_is_larger_than_its_interval(paper, ours, finding: str):
    others = [gain(loss, "above_chance", 0.0, 1.0) for loss in ("paper", "recommended")]
    figure = variants.ablation_figure(both_measures("made up"), pd.DataFrame([paper, ours, *others]))
    assert [title.split(":\n")[1] for title in titles(figure)] == ["neither clearly changes it", finding]


def test_ablation_has_a_row_of_panels_a_corpus_and_marks_only_the_synthetic_one():
    corpora = ("beatlocked", "synthetic")
    every = product(corpora, ("paper", "recommended"), ("above_chance", "fid"))
    gains = [gain(loss, measure, 1.0, 0.5, corpus) for corpus, loss, measure in every]
    figure = variants.ablation_figure(both_measures(*corpora), pd.DataFrame(gains))
    assert titles(figure, "right") == ["", "", "", "synthetic data"]
    assert "recordings on the beat" in titles(figure)[0]


# The trade-off


def test_interval_of_a_distance_does_not_go_below_0(ax: Axes):
    rows = both_measures("made up").reset_index(drop=True)
    rows.loc[(rows["variant"] == "paper") & (rows["measure"] == "fid"), ["low", "high"]] = -2.0, 18.0
    variants.draw_trade_off(ax, rows, pd.DataFrame(columns=["fid", "above_chance"]), "fid")
    assert spans(ax) == [[0.0, 18.0]]


def test_titles_of_the_trade_off_are_changes_by_our_harmony_term():
    sweep = pd.DataFrame([{"corpus": "one", "harmony_weight": 0.1, "above_chance": 0.6, "fid": 6.5, "jerk": 2.0}])
    figure = variants.trade_off_figure(both_measures("one", "synthetic"), sweep)
    assert titles(figure)[:2] == ["One, our harmony term:\nharmony 0.30 → 0.90, jerk 3 → 4", "FID 7.0 → 6.0"]
    assert titles(figure, "right")[3] == "synthetic data"
    assert [len(spans(ax, "sweep")) for ax in figure.axes] == [1, 0, 0, 0]
    assert smallest_text(figure) >= 9


# Votes


def votes(**shares: float) -> pd.DataFrame:
    """The votes of the paper's harmony and of harmony above chance on our losses."""
    judges = zip(variants.JUDGES, shares.values(), strict=False)
    about = {"first": "paper", "second": "recommended", "n": 49, "corpus": "made up"}
    return pd.DataFrame([{**about, "judge": judge, "share": share} for judge, share in judges])


def test_picture_of_votes_says_which_variant_each_score_likes_best_and_that_nobody_was_asked():
    lines = ["Made up, 49 units, no people asked:"]
    for judge, name in (("paper's harmony", "paper"), ("above chance", "recommended")):
        lines.append(f"“{judge}” likes “{LOOKS[name].label}” best")
    assert titles(variants.forced_choice_figure(votes(paper=0.9, above=0.2))) == ["\n".join(lines)]


def test_looks_differ_in_mark_as_well_as_colour_and_take_no_colour_that_means_something_else():
    assert {look.colour for name, look in LOOKS.items() if name != "recorded"}.isdisjoint(map(to_hex, COLOURS.values()))
    assert LOOKS["paper"].marker != LOOKS["recommended"].marker
    assert [name for name, look in LOOKS.items() if not look.filled] == ["paper, without", "recommended, without"]


# Tricks


def trick(name: str, music: str, mean: float, measure: str = "paper_hit_rate", corpus: str = "made up"):
    about = {"corpus": corpus, "trick": name, "music": music, "measure": measure, "n": 7}
    return {**about, "mean": mean, "low": mean - 0.1, "high": mean + 0.1}


def both_scores(means: dict[tuple[str, str], tuple[float, float]], *corpora: str) -> pd.DataFrame:
    """Rows of (hit rate, harmony above chance) for each (trick, music)."""
    pairs = [(key, each) for key, values in means.items() for each in zip(variants.SIDES, values, strict=True)]
    every = product(corpora, pairs)
    return pd.DataFrame([trick(*key, mean, measure, corpus) for corpus, (key, (measure, mean)) in every])


@pytest.mark.usefixtures("saving")
def test_tricks_are_counted_for_both_scores_and_drawn_for_one_corpus_in_the_papers():
    means = {("as danced", "true"): (0.6, 0.5), ("shake", "true"): (0.9, 0.0), ("sway", "true"): (0.7, 0.6)}
    means |= {(trick, "late"): (0.5, 0.0) for trick, _ in means}
    (ax,) = (figure := variants.tricks_figure(both_scores(means, "beatlocked", "synthetic"))).axes
    words = "Do tricks please the score? 2 of 2 raise the paper's hit rate, 1 of 2 harmony above chance"
    assert titles(figure) == [words]
    assert ax.get_xlabel().endswith("(7 clips, recordings on the beat)")
    numbers = {text.get_position()[1]: text.get_text() for text in ax.texts if text.get_text()[:1] in "+-"}
    assert [numbers[place] for place in (2, 1, 0)] == ["+0.50", "+0.00", "+0.60"]
    assert titles(variants.tricks_figure(both_scores(means, "synthetic")), "right")[0].strip() == "synthetic data"
    # The picture of a recorded corpus is not called synthetic because its table has more.
    save_figure(figure, "tricks", tables=(), **ABOUT | {"source": "beatlocked + synthetic"})
    assert not [text for text in figure.findobj(Text) if "synthetic data" in text.get_text()]


def test_titles_name_whose_score_clearly_falls_with_late_music():
    means = {("paper", "true"): (0.6, 0.1), ("recommended", "true"): (0.8, 0.8)}
    means |= {("paper", "late"): (0.5, 0.0), ("recommended", "late"): (0.7, -0.4)}
    figure = variants.listening_figure(both_scores(means, "made up"))
    endings = [" ".join(title.split("\n")[1:]) for title in titles(figure)]
    assert endings == [f"with late music it falls for {name}" for name in ("nobody", LOOKS["recommended"].label)]


# Systems compared (Fig. 12)


def row(system: str, kind: str, rate: float, low: float = np.nan, high: float = np.nan, **more: Any) -> dict[str, Any]:
    about: dict[str, Any] = {"music": "songs", "corpus": "mine", "system": system, "kind": kind, "remark": ""}
    return {**about, "hit_rate": rate, "hit_rate low": low, "hit_rate high": high, "hit_rate chance": 0.4} | more


ROWS = pd.DataFrame(
    [
        row("recorded, right song", "recorded", 0.3, 0.2, 0.4),
        row("random pieces", "pieces", 0.35),
        row("Ren et al. 2020", "network", np.nan, remark="not trained well enough: speed"),
        row("HarmoGAN", "network", 0.5, 0.45, 0.55),
    ]
)


def test_one_contest_is_drawn_to_recorded_songs_where_there_are_any_and_its_title_counts_systems():
    lows = (("network", 0.35), ("network", 0.55), ("pieces", 0.55))  # pieces are no system
    measured = [row(f"{kind} from {low}", kind, 0.6, low, 0.7) for kind, low in lows]
    planted, other = ROWS.assign(music="synthetic songs"), pd.DataFrame(measured).assign(music="other songs")
    (title,) = titles(variants.comparison_figure(pd.concat([planted, other])))
    question, about = title.split("\n")
    assert question.endswith("1 of 2 with an interval") and about == "Other songs; trained on mine"
    assert titles(figure := variants.comparison_figure(planted))[0].endswith("Synthetic songs; trained on mine")
    assert [words.strip() for words in titles(figure, "right")] == ["synthetic data"]


# The networks (Fig. 7)

NETWORKS = {
    "generator": "audio initial hearing encoder seeing decoder flat_head depth_head path_head motion flat",
    "cross_domain": "audio motion hearing seeing both verdict output",
    "spatial_temporal": "motion seeing joining.0 joining.1 joining.2 joining.3 verdict output",
}
SIGNALS = ("audio", "initial", "motion", "flat", "output")
PARTS = [
    {"network": network, "name": name, "layers": "input", "parameters": 0, "shape": f"of {name}"}
    | ({} if name in SIGNALS else {"layers": "GRU", "parameters": 1_100})
    for network, names in NETWORKS.items()
    for name in names.split()
]
BOTH = {"paper": TrainParams.paper(), "ours": TrainParams.recommended()}
DIAGRAMS = [framework.networks_figure(PARTS), framework_figure(PARTS, BOTH), framework.dancing_figure()]


@pytest.mark.parametrize("figure", DIAGRAMS)
def test_nothing_in_the_drawing_is_left_to_measure_all_of_it_is_on_the_paper_and_boxes_do_not_overlap(figure: Figure):
    (ax,) = figure.axes
    assert not [text for text in texts(ax) if re.search(r"(?<!_)\{", text)]
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    for text in ax.texts:
        x, y = text.get_position()
        assert left <= x <= right and bottom <= y <= top
    boxes = [patch.get_window_extent() for patch in ax.patches if patch.get_gid() == "box"]
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))


def test_the_only_discriminator_that_counts_is_named():
    params = {"paper": TrainParams.paper(), "ours": replace(TrainParams.paper(), gan_weight=0.1, cross_domain_weight=0)}
    assert "weight: paper 0.001, ours 0.1 ($D_{st}$ alone)" in texts(framework_figure(PARTS, params).axes[0])


def test_every_loss_weight_of_the_settings_is_in_the_picture():
    weights = {name.removesuffix("_weight") for name in vars(TrainParams.paper()) if name.endswith("_weight")}
    parts_of_terms = {"pretrain_kl", "count", "cross_domain"}
    assert set(re.findall(r"\{weight\.(\w+)\}", framework.DRAWING.read_text("utf-8"))) == weights - parts_of_terms


@cases("count, text", (0, "0"), (999, "999"), (1000, "1.0 k"), (99_960, "100 k"), (7.25e6, "7.2 M"))
def test_counts_are_short(count: int, text: str):
    assert framework.count_text(count) == text


# Training (Fig. 7)


def course(variant: str, **losses: float) -> list[dict[str, Any]]:
    """Ten epochs of pretraining, validated at the fifth and the tenth, and three adversarial ones."""
    early, late = [{"variant": variant, "phase": phase} for phase in ("pretrain", "adversarial")]
    due = {epoch: {"val_harmony": 0.2, "val_above_chance": 0.0} for epoch in (4, 9)}
    rows = [early | {"epoch": epoch, "mse": 10.0 - epoch} | due.get(epoch, {}) for epoch in range(10)]
    scores = {"mse": 1.0, "gan": 1.3, "val_above_chance": -0.1, "val_count_ratio": 1.2, **losses}
    return rows + [late | {"epoch": epoch, "val_harmony": 0.3 + 0.1 * epoch} | scores for epoch in range(3)]


def history(*courses: list[dict[str, Any]]) -> pd.DataFrame:
    """Courses as one table with all columns of a history."""
    table = pd.DataFrame([row for rows in courses for row in rows])
    columns = [*table.columns, *TRAINING.VALIDATED, *(column for _, column, _ in TRAINING.TERMS)]
    return table.reindex(columns=[*dict.fromkeys(columns)])


COURSES = history(course("paper, without"), course("paper", harmony=-0.5), course("recommended", harmony=2.0))


def test_every_term_has_its_panel_and_the_two_harmony_losses_never_share_a_scale():
    figure = TRAINING.losses_figure(COURSES)
    panels = {ax.get_title(loc="left").split("\n")[0]: ax for ax in figure.axes}
    assert list(panels) == [title for title, *_ in TRAINING.TERMS]
    for title, loss in (("our harmony", 2.0), ("paper's harmony (Eq. 27)", -0.5)):
        (line,) = panels[title].lines
        np.testing.assert_array_equal(line.get_ydata(), [loss] * 3)
    assert smallest_text(figure) >= 9


def test_validation_has_the_papers_scores_and_what_they_do_not_tell():
    assert titles(TRAINING.validation_figure(COURSES)) == [words for words, _ in TRAINING.VALIDATED.values()]


# Distances (Fig. 9)

DISTANCES = {"paper, without": (20.0,), "paper": (25.0, 22.0, 28.0)}
DISTANCES |= {"recorded, halves": (-0.02, -1.0, 1.0), "recorded, other figures": (3.0, 2.0, 4.0)}
MEASURED = pd.DataFrame([record(name, "fid", *numbers) for name, numbers in DISTANCES.items()])


def test_no_distance_is_written_as_minus_0(ax: Axes):
    variants.draw_distances(ax, MEASURED, "fid")
    assert sorted(texts(ax)) == ["0.0", "20.0", "25.0", "3.0"]


def test_the_distance_of_speeds_of_the_first_corpus_is_drawn_and_its_title_names_the_nearest_generator():
    poses = pd.concat(MEASURED.assign(corpus=corpus) for corpus in ("beatlocked", "synthetic"))
    speeds = poses.assign(measure="fid_kinetic")
    (title,) = titles(figure := variants.distances_figure(pd.concat([poses.assign(mean=-poses["mean"]), speeds])))
    assert f"Nearest, not clearly: “{LOOKS['paper, without'].label}”\n(recordings on the beat)" in title
    assert "distance of joint speeds" in figure.axes[0].get_xlabel()


@cases("high, words", (21.9, "Nearest: "), (22.1, "Nearest, not clearly: "))
def test_a_generator_is_the_nearest_where_no_other_interval_reaches_into_its_own(high: float, words: str):
    rivals = {"recommended": (20.0, 18.0, high), "paper": (25.0, 22.0, 28.0)}
    rows = pd.DataFrame([record(name, "fid_kinetic", *numbers) for name, numbers in rivals.items()])
    assert f"{words}“{LOOKS['recommended'].label}”" in titles(variants.distances_figure(rows))[0]


# Recorded and generated (Fig. 10)


def standing(n_frames: int = 31) -> Motion:
    pose = np.array([[0.0, 1.0, 0.0], [0.0, 1.7, 0.0]])
    return Motion(np.repeat(pose[None], n_frames, axis=0), 15.0, Skeleton(("hips", "head"), (-1, 0)))


def test_shots_are_as_far_apart_as_they_can_be_at_equal_steps():
    for frames in (31, 33):
        np.testing.assert_allclose(QUALITY.shot_times(standing(frames), 4) * 15, [0, 10, 20, 30])


def test_recorded_and_generated_stand_under_each_other_at_the_same_moments_and_what_was_given_is_shaded():
    verdicts = {"recorded": "all met", "paper": "none met"}
    motions = dict.fromkeys(verdicts, standing())
    figure = QUALITY.sequences_figure(SimpleNamespace(motions=motions, start=1.0, verdicts=verdicts), "waltz")
    assert titles(figure) == [f"{LOOKS[name].label}: {words}" for name, words in verdicts.items()]
    for ax in figure.axes:
        at = [artist.xy[0] for artist in ax.get_children() if isinstance(artist, AnnotationBbox)]
        np.testing.assert_allclose(at, np.arange(10) * 3 / 15)
        (shade,) = [patch for patch in ax.patches if patch.get_gid() == "given"]
        assert shade.get_x() + shade.get_width() == pytest.approx(1.0)
        low, high = ax.get_xlim()
        assert low < 0.0 < 27 / 15 < high


# Figures that are drawn again from the tables beside them

SHIPPED = Path(__file__).parents[1] / "figures"
ENTRIES = json.loads((SHIPPED / MANIFEST).read_text("utf-8"))
PINS = (SHIPPED.parent / "constraints.txt").read_text("utf-8")
SAME = 0.05  # of 255: values rounded otherwise make 0.008 at most, and the least mark lost makes 0.27
# Drawn of bodies, of sound, or of the shapes of a network, by the patterns of their names.
OF_NO_TABLE = (
    *("fig0[0-6]_*", "fig01_03_*", "fig05b_*", "fig10_*", "fig12_sheet_*", "fig14*", "own_dance_*"),
    *("m2d_fig0[2-5]_*", "m2d_fig07_*", "a2b_features", "a2b_fig0[124789]*_*", "a2b_fig03_planted"),
    *("a2b_fig1[01]_*", "a2b_video_*"),
)


def tables_of(name: str) -> list[str]:
    """The files of the tables that give a picture."""
    return [f"{table}.csv" for table in PICTURES[name][2:]]


@pytest.fixture(scope="module")
def drawn() -> dict[str, Figure]:
    """Every picture that the shipped tables give."""
    there = [name for name in PICTURES if f"{name}.png" in ENTRIES and {*tables_of(name)} <= set(ENTRIES)]
    return {name: redraw.drawn_again(name, RunTables(SHIPPED), ENTRIES[f"{name}.png"]) for name in there}


@pytest.mark.slow
def test_shipped_tables_give_figures_of_large_letters_and_words_without_the_name_of_a_corpus(drawn: dict[str, Figure]):
    assert {f"{name}.png" for name, figure in drawn.items() if smallest_text(figure) < 9} <= TOO_WIDE
    assert {"fig11_harmony_loss", "m2d_chance", "a2b_hits", "cheating_on_the_beat"} <= set(drawn)
    for name, figure in drawn.items():
        words = " ".join(text.get_text() for text in figure.findobj(Text))
        assert not re.search("beatlocked|realdance|tang2018", words), name


def unlike(one: Path, other: Path) -> float:
    """By how many of 255 the colours of two pictures differ, root mean square; infinite if their sizes do."""
    shades, others = (255 * imread(path)[..., :3] for path in (one, other))
    return float(np.sqrt(np.mean((shades - others) ** 2))) if shades.shape == others.shape else np.inf


# With other letters all else moves too: without hinting the same pictures differ by 24 to 44, or have other sizes.
LETTERS_ALIKE = ft2font.__freetype_build_type__ == "local" and f"\nmatplotlib=={mpl.__version__}\n" in PINS


@pytest.mark.slow
@pytest.mark.skipif(
    not LETTERS_ALIKE, reason="other letters: not the matplotlib of constraints.txt with its own freetype"
)
@pytest.mark.usefixtures("saving")
def test_every_mark_line_colour_and_word_of_a_picture_is_drawn_of_its_tables_as_published(drawn: dict[str, Figure]):
    apart = {}
    for name, figure in drawn.items():
        about = ABOUT | {"source": ENTRIES[f"{name}.png"]["source"], "profile": RunProfile.full()}
        apart[name] = unlike(SHIPPED / f"{name}.png", save_figure(figure, name, tables=(), **about).path)
    changed = {name: round(difference, 2) for name, difference in apart.items() if difference > SAME}
    assert not changed, "see what is new in them; if it is meant: make figures FROM=tables"


@pytest.mark.slow
def test_every_shipped_picture_names_its_tables_or_is_drawn_of_none(drawn: dict[str, Figure]):
    pictures = {name.removesuffix(".png"): entry for name, entry in ENTRIES.items() if name.endswith(".png")}
    assert {path.stem for path in SHIPPED.glob("*.png")} == set(pictures)
    of_none = {name for name in pictures if any(fnmatchcase(name, pattern) for pattern in OF_NO_TABLE)}
    assert of_none == set(pictures) - set(PICTURES)
    named = {name: entry["tables"] for name, entry in pictures.items() if "tables" in entry}
    assert named == {name: [] for name in of_none} | {name: tables_of(name) for name in drawn}
    assert all((SHIPPED / table).is_file() for tables in named.values() for table in tables)


def test_function_that_draws_stands_where_the_list_says():
    for place, function, *_ in PICTURES.values():
        assert callable(getattr(redraw.place_of(place), function)), (place, function)
    assert set(redraw.OPTIONS) <= set(PICTURES)


def test_picture_is_refused_without_its_table_and_drawn_as_soon_as_it_is_there(tmp_path: Path):
    name, tables = "fig11b_trade_off", RunTables(tmp_path)
    means = pd.read_csv(shutil.copy(SHIPPED / "table11_ablation.csv", tmp_path))
    with pytest.raises(FileNotFoundError, match=r"table11d_trade_off\.csv"):
        redraw.drawn_again(name, tables, ENTRIES["fig11_harmony_loss.png"])
    sweep = {"corpus": means["corpus"][:1], "harmony_weight": 0.1, "above_chance": 0.5, "jerk": 80.0, "fid": 2.0}
    pd.DataFrame(sweep).to_csv(tmp_path / "table11d_trade_off.csv", index=False)
    assert redraw.drawn_again(name, tables, ENTRIES["fig11_harmony_loss.png"]).axes


def test_figure_is_saved_only_after_its_tables_and_the_manifest_names_them(ax: Axes, saving: Path):
    for name, tables in (("a2b_steps", None), ("any", ("a2b_steps",))):
        refused(r"a2b_steps\.csv, not saved", save_figure, ax.figure, name, tables=tables, **ABOUT)
    save_table(MEASURED, "a2b_steps", **ABOUT)
    save_figure(ax.figure, "a2b_steps", trained=True, **ABOUT)
    entry = json.loads((saving / MANIFEST).read_text("utf-8"))["a2b_steps.png"]
    assert (entry["tables"], entry["trained"]) == (["a2b_steps.csv"], True)


@pytest.mark.slow
def test_weights_of_marks_are_those_they_were_computed_with():
    weights, totals = notebook_cells("16_music2dance").MARKS, pd.read_csv(SHIPPED / "m2d_table03_machine.csv")
    np.testing.assert_allclose(totals[list(weights)] @ list(weights.values()), totals["total"], atol=0.002)


@pytest.mark.slow
def test_figures_drawn_again_keep_their_entries_and_what_is_left_out_has_a_reason(tmp_path: Path, monkeypatch, capsys):
    few = ("cheating_tricks", "a2b_hits", "fig11_harmony_loss", "a2b_steps")
    monkeypatch.setattr(redraw, "PICTURES", {name: PICTURES[name] for name in few})
    monkeypatch.setenv("HARMOLAB_FIGURES", "elsewhere")
    for name in (MANIFEST, *tables_of("cheating_tricks"), *tables_of("a2b_hits"), "table11_ablation.csv"):
        shutil.copy(SHIPPED / name, tmp_path)
    redraw.main(["--folder", str(tmp_path)])
    lines = capsys.readouterr().out.splitlines()
    assert lines[2] == " 3 of 4: fig11_harmony_loss is left out: its table table11b_gains.csv is not there"
    assert lines[4].startswith("2 drawn, 2 left out")
    assert {path.stem for path in tmp_path.glob("*.png") if path.stat().st_size > 10_000} == set(few[:2])
    assert len([*tmp_path.glob("*.png")]) == 2
    after = json.loads((tmp_path / MANIFEST).read_text("utf-8"))
    one, other = ([entry | {"version": ""} for entry in entries.values()] for entries in (after, ENTRIES))
    assert one == other


@pytest.mark.usefixtures("saving")
def test_legend_at_the_edge_stays_above_the_mark_for_synthetic_data():
    with styled_axes((6.0, 3.0)) as (figure, (ax,)):
        ax.set_axis_off()
        figure.legend(handles=[Patch(color="#0000FF", label=40 * "i")], loc="outside lower right")
    picture = imread(save_figure(figure, "legend", **ABOUT | {"source": "synthetic"}).path)
    red, _, blue = np.moveaxis(picture[..., :3], -1, 0)
    of_legend, of_mark = (np.flatnonzero(mask.any(axis=1)) for mask in (blue - red > 0.8, red - blue > 0.3))
    assert of_legend.size and of_mark.size and of_legend.max() < of_mark.min()


# Wider than a page of the report is for letters of 8 points; its own have 8.5.
TOO_WIDE = {"fig07c_networks.png"}


def inches(path: Path) -> float:
    """Width of a PNG by its pixels a metre."""
    data = path.read_bytes()
    place = data.index(b"pHYs") + 4
    return int.from_bytes(data[16:20]) / (int.from_bytes(data[place : place + 4]) * 0.0254)


def test_letters_of_eight_points_have_nine_pixels_in_every_shipped_figure_on_a_page_of_the_report():
    widest = PAGE_WIDTH * 8 / (9 * 72)
    assert {path.name for path in SHIPPED.glob("*.png") if inches(path) > widest} == TOO_WIDE


def test_words_about_a_column_that_the_published_run_has_not_say_that_it_is_older(tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # as on Colab, where notebooks run in another folder than their own
    words = headline(lambda tables: str(tables["table11_ablation"]["a column of tomorrow"].sum())).data
    assert words.startswith("**The published full run is older than these words (it has no 'a column of tomorrow').**")
    assert "table_of_tomorrow.csv is missing" in headline(lambda tables: str(tables["table_of_tomorrow"])).data
