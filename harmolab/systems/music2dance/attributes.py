"""The dance that a song calls for: the paper's attribute classifier (Sec. 4.3, Fig. 5), its baseline, their training.

Its classes are dances, or groups of dances, since we have no songs that were sorted by mood. It is trained by itself,
into a folder of its own inside the run of a dancer, RUN/attributes, where the dancer finds it. R12 is reading 12 of the
paper in docs/readings_music2dance.md.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal, NamedTuple, Self

import numpy as np
import scipy
import torch
from torch import Tensor, nn
from torch.nn.functional import cross_entropy

from harmolab.data.oddities import sound_oddities
from harmolab.data.recordings import recording_files
from harmolab.files import PathLike, Progress, silent
from harmolab.readers.audio import load_audio
from harmolab.systems.music2dance.music_features import CHANNELS, blind_features
from harmolab.systems.music2dance.params import MOST_RATE, MOST_SECONDS, PRESETS
from harmolab.systems.training import layers
from harmolab.systems.training.about import read_about, stored_list
from harmolab.systems.training.checkpoints import TrainOptions
from harmolab.systems.training.features import check_settings
from harmolab.systems.training.loop import Batching, Phase, Player, Rows, Shard, Terms, make_fabric
from harmolab.systems.training.network_system import Learner, preset_settings
from harmolab.systems.training.runs import open_run
from harmolab.systems.training.units import recording_folders
from harmolab.systems.training.weights import stored_record
from harmolab.types import FloatArray, IntArray, SingleArray

Front = Literal["convolution", "frames"]
N_AUDIO = 15
MOST_CLASSES, LONGEST_NAME = 256, 64
MOST_OVERLAP = 30  # windows that a moment of a song may be part of; more would only fill the memory
AT_ONCE = 64  # windows of a song that are heard at once, so that a long song takes little memory
SETTLED = 256  # windows that batch normalisation takes its last statistics from, at most


@dataclass(frozen=True)
class AttributeParams:
    """Settings of the classifier of songs by dance, and of its training; the defaults are the paper's.

    Parameters
    ----------
    front : "convolution" or "frames"
        Temporal convolutions, or for the baseline of Table 1 single frames.
    channels : tuple of int
        Channels of the temporal convolutions.
    hidden : int
        Units of the LSTM in each direction.
    dropout : float
        Share that is left out in training, below 1.
    window, hop : float, seconds
        Length of the windows of a song that are classified, and time from one to the next. A shorter song is filled up
        with zeros.
    rate : float, hertz
        Of the features of the music.
    epochs, batch_size, learning_rate : int, int and float
        Of the training by Adam.
    drops : tuple of float
        Shares of the epochs after which the learning rate falls to a tenth.
    seed : int

    Raises
    ------
    ValueError
        For a value out of range or of another kind.
    """

    front: Front = "convolution"
    channels: tuple[int, ...] = (16, 24, 32)
    hidden: int = 15
    dropout: float = 0.1
    window: float = 30.0
    hop: float = 5.0
    rate: float = 10.0
    epochs: int = 30
    batch_size: int = 128
    learning_rate: float = 1e-3
    drops: tuple[float, ...] = (18 / 30, 25 / 30)
    seed: int = 1

    def __post_init__(self) -> None:
        check_settings(self, not_negative=("dropout", "epochs", "seed"))
        if not self.channels or min(self.channels) < 1 or self.dropout >= 1:
            raise ValueError("convolutions need channels, and dropout must leave something")
        if self.n_cells < 1 or self.rate > MOST_RATE or self.window > min(MOST_SECONDS, MOST_OVERLAP * self.hop):
            raise ValueError("rate, window and hop must be of a size that a song can be heard in")

    @classmethod
    def paper(cls) -> "AttributeParams":
        """The paper's settings, as printed."""
        return cls()

    @classmethod
    def recommended(cls) -> "AttributeParams":
        """The paper's with batches of 8: corpora have tens of songs, and batches of 128 would leave a few updates."""
        return cls(batch_size=8)

    @property
    def n_cells(self) -> int:
        """Number of moments M in a window."""
        return round(self.window * self.rate)


class Song(NamedTuple):
    """The features (M, 15) of a song, found without knowing its dance, and the number of its class."""

    name: str
    music: SingleArray
    label: int


class AttributeClassifier(nn.Module):
    """The classifier of songs by dance, a network: which dance does a song call for (Sec. 4.3, Fig. 5)?

    It maps windows of music features (N, M, 15) to logits (N, classes): mapping network, mean over time, one layer.
    `Music2Dance.dance_probabilities` asks the one that lies in a run.

    Parameters
    ----------
    params : AttributeParams
    classes : sequence of str
        Names of the dances.

    Attributes
    ----------
    meta : dict
        About its training; kept with the weights.
    """

    system = "attributes"

    def __init__(self, params: AttributeParams, classes: Sequence[str]) -> None:
        super().__init__()
        self.params, self.classes = params, tuple(classes)
        self.meta: dict[str, Any] = {}
        self.audio_scale = layers.Normaliser(N_AUDIO)
        if params.front == "convolution":
            front: Any = layers.TemporalConvolution(N_AUDIO, params.channels, params.dropout)
        else:
            front = layers.FrameLayers(N_AUDIO)
        self.encoder = layers.SongEncoder(front, params.hidden)
        self.verdict = nn.Linear(self.encoder.size, len(self.classes))

    def forward(self, music: Tensor) -> Tensor:
        return self.verdict(self.encoder(self.audio_scale(music)).mean(dim=1))

    def probabilities(self, music: SingleArray) -> FloatArray:
        """Probabilities (K,) of the K classes for a song's features (M, 15): the mean over its windows (R13)."""
        return self.window_probabilities(music).mean(axis=0)

    @torch.no_grad()
    def window_probabilities(self, music: SingleArray) -> FloatArray:
        """Probabilities of the K classes in each of the N windows of a song, (N, K)."""
        self.eval()
        device = self.audio_scale.mean.device
        parts = torch.from_numpy(song_windows(music, self.params)).split(AT_ONCE)
        return torch.cat([self(part.to(device)).softmax(dim=1) for part in parts]).double().cpu().numpy()

    def description(self) -> dict[str, Any]:
        """All that `built` needs beside the tensors, JSON-able."""
        return {"params": asdict(self.params), "classes": list(self.classes)}

    @classmethod
    def built(cls, build: Mapping[str, Any], tensors: Mapping[str, Tensor]) -> Self:
        """A classifier as its description says; ValueError for sizes that cannot be."""
        classes = [str(name) for name in stored_list(build, "classes")]
        if not 0 < len(classes) == len(set(classes)) <= MOST_CLASSES or max(map(len, classes)) > LONGEST_NAME:
            needed = f"one to {MOST_CLASSES} different names of {LONGEST_NAME} letters at most are needed"
            raise ValueError(f"describes {len(classes)} classes; {needed}")
        return cls(stored_record(AttributeParams, build["params"]), classes)


def song_windows(music: SingleArray, params: AttributeParams) -> SingleArray:
    """Windows (N, M', 15) of a song's features, `hop` apart, the last at its end; a short song is filled with zeros."""
    music = np.pad(music, ((0, max(0, params.n_cells - len(music))), (0, 0)))
    return np.stack([music[start : start + params.n_cells] for start in window_starts(len(music), params)])


def window_starts(cells: int, params: AttributeParams) -> IntArray:
    """First moment of each window of a song of so many moments: (N,)."""
    last = max(0, cells - params.n_cells)
    hop = max(1, round(params.hop * params.rate))
    return np.unique(np.append(np.arange(0, last + 1, hop), last))


@dataclass(frozen=True, eq=False)
class SongWindows(Rows):
    """Windows of songs and their classes (`harmolab.systems.training.loop.Units`)."""

    music: Tensor
    label: Tensor

    @classmethod
    def of(cls, songs: Sequence[Song], params: AttributeParams, device: torch.device | str = "cpu") -> "SongWindows":
        """All windows of some songs."""
        parts = [song_windows(song.music, params) for song in songs]
        labels = [song.label for song, part in zip(songs, parts, strict=True) for _ in part]
        return cls(torch.from_numpy(np.concatenate(parts)).to(device), torch.tensor(labels, device=device))


@dataclass(frozen=True)
class SongSplit:
    """Names of songs on each side; ValueError for a song on both."""

    train: tuple[str, ...]
    test: tuple[str, ...]

    def __post_init__(self) -> None:
        if shared := sorted({*self.train} & {*self.test}):
            raise ValueError(f"{shared[0]!r} is on both sides of the split")

    def to_dict(self) -> dict[str, Any]:
        """Ready for JSON."""
        return asdict(self)


def train_attributes(
    songs: Sequence[Song], classes: Sequence[str], split: SongSplit, options: TrainOptions, params: AttributeParams
) -> AttributeClassifier:
    """Train a classifier on the songs of a split's training side, and keep everything about it in `options.out`.

    "meta" of its weights has the outcome on the songs of the test side (`outcome`).

    Raises
    ------
    ValueError
        As `open_run`; if the split has no song to train on, a song of the test side is trained on under another name,
        or two songs have one name.
    """
    selected, held_out = side_songs(songs, split)
    fabric = make_fabric(accelerator=options.accelerator)
    windows = SongWindows.of(selected, params, fabric.device)
    batching = Batching(params.batch_size, 1, params.seed)
    settings = {"attributes": params, "classes": list(classes)}
    with open_run(fabric, options, split, settings, batching, len(windows)) as run:
        classifier = _initial(windows, params, classes).to(fabric.device)
        run.fit([_phase(classifier, params)], windows)
        rows = torch.linspace(0, len(windows) - 1, min(SETTLED, len(windows))).long()
        classifier.encoder.settle(classifier.audio_scale(windows.music[rows]))
        about = {"songs": len(selected), "windows": len(windows), "test": outcome(classifier, selected, held_out)}
        run.save(classifier.eval(), about)
    return classifier


def side_songs(songs: Sequence[Song], split: SongSplit) -> tuple[list[Song], list[Song]]:
    """The songs of the training and of the test side; ValueError where a song is on both, or none is trained on."""
    if len({song.name for song in songs}) < len(songs):
        raise ValueError("two songs have one name")
    train, test = ([song for song in songs if song.name in side] for side in (split.train, split.test))
    if not train:
        raise ValueError("no song to train on")
    names = {song.music.tobytes(): song.name for song in train}
    if leaking := next((song for song in test if song.music.tobytes() in names), None):
        raise ValueError(f"{leaking.name!r} is tested on, but trained on as {names[leaking.music.tobytes()]!r}")
    return train, test


def outcome(classifier: AttributeClassifier, train: Sequence[Song], test: Sequence[Song]) -> dict[str, int]:
    """Numbers of test songs: all, those whose class is predicted, those of the most frequent class in training.

    The class of a song is that of the mean over its windows (R13).
    """
    right = sum(int(classifier.probabilities(song.music).argmax()) == song.label for song in test)
    most_frequent = int(np.bincount([song.label for song in train]).argmax())
    return {"songs": len(test), "right": right, "majority": sum(song.label == most_frequent for song in test)}


def _initial(windows: SongWindows, params: AttributeParams, classes: Sequence[str]) -> AttributeClassifier:
    with layers.drawn_by(params.seed):
        classifier = AttributeClassifier(params, classes)
    classifier.audio_scale.set(*layers.channel_statistics(windows.music.cpu(), torch.ones(windows.music.shape[:2])))
    return classifier


def _phase(classifier: AttributeClassifier, params: AttributeParams) -> Phase:
    return Phase(
        "attributes", params.epochs,
        lambda number: params.learning_rate * 0.1 ** sum(number >= drop * params.epochs for drop in params.drops),
        {"classifier": classifier},
        [Player("classifier", [*classifier.parameters()], _terms, {"entropy": 1.0, "right": 0.0})],
        forward=lambda shard, last: _logits(classifier, shard),
    )  # fmt: skip


def _logits(classifier: AttributeClassifier, shard: Shard) -> Tensor:
    with layers.drawn_by(shard.seed, shard.own.music.device):
        return classifier.train()(shard.own.music)


def _terms(logits: Tensor, shard: Shard, row: object) -> Terms:
    label = shard.own.label
    return {"entropy": cross_entropy(logits, label), "right": (logits.argmax(dim=1) == label).float().mean().detach()}


# The songs of corpora, each once, with the dance that was danced to it

TEST_SHARE = 0.2  # of the songs of each dance
EXCERPT = 200  # moments (20 s) by which songs are compared
# Least correlation of two encodings of one song: in the recorded corpora these have .98 and more, other songs .29 at
# most, synthetic songs of one dance .68.
SAME = 0.9
SOUND = [number for number, name in enumerate(CHANNELS) if name not in ("beat", "downbeat")]  # tracked beats may differ


class SongSet(NamedTuple):
    """Songs, the names of their classes, and a note for each recording whose song is not among them."""

    songs: tuple[Song, ...]
    classes: tuple[str, ...]
    notes: tuple[str, ...]


def load_songs(roots: Sequence[PathLike], *, progress: Progress = silent) -> SongSet:
    """The songs of corpora; a song that several recordings have, be it cut or encoded anew, is there once.

    Parameters
    ----------
    roots : folders of recordings
    progress : function(iterable, label) -> iterable

    Raises
    ------
    FileNotFoundError, ValueError
        A root is missing, or there are no two songs of two dances.
    """
    folders, notes = recording_folders(roots)
    labelled: list[tuple[str, SingleArray, str]] = []
    for folder in progress(folders, "reading songs"):
        name = f"{folder.resolve().parent.name}/{folder.name}"
        try:
            files = recording_files(folder)
            if not files.dance:
                raise ValueError(f"{folder}: no dance is named in beats.json")
            audio = load_audio(files.song)
            if not audio.samples.any():
                raise ValueError(f"{folder}: {sound_oddities(audio)[0]}")
            music = blind_features(audio)
        except (ValueError, FileNotFoundError) as error:
            notes.append(str(error))
            continue
        if same := next((other for other, earlier, _ in labelled if is_same_song(music, earlier)), None):
            notes.append(f"{folder}: has the song of {same}")
            continue
        labelled.append((name, music, files.dance))
    classes = tuple(sorted({dance for _, _, dance in labelled}))
    if len(classes) < 2:
        place, of = ", ".join(map(str, roots)), f", of {classes[0]}" if classes else ""
        left = f" (left out: {notes[0]})" if notes else ""
        needed = "a classifier needs songs of two dances or more"
        raise ValueError(f"{place}: {needed}; songs here: {len(labelled)}{of}{left}")
    songs = [Song(name, music, classes.index(dance)) for name, music, dance in labelled]
    return SongSet(tuple(songs), classes, tuple(notes))


def is_same_song(one: SingleArray, other: SingleArray) -> bool:
    """True where the middle of one song's features (M, 15) is somewhere in the other's, or the other way round."""
    return max(_likeness(one, other), _likeness(other, one)) > SAME


def _likeness(one: SingleArray, other: SingleArray) -> float:
    """Highest correlation of the middle 20 s of one song's onsets and chroma with as long a stretch of another's."""
    parts = [part[:, SOUND].astype(np.float64) for part in (one, other)]
    query, song = (part - part.mean(axis=0) for part in parts)
    first = max(0, (len(query) - EXCERPT) // 2)
    query = query[first : first + EXCERPT]
    if len(song) < len(query):
        return 0.0
    products = scipy.signal.fftconvolve(song, query[::-1], mode="valid", axes=0).sum(axis=1)
    energy = np.concatenate([[0.0], np.cumsum((song**2).sum(axis=1))])
    norms = np.sqrt(np.maximum((energy[len(query) :] - energy[: -len(query)]) * (query**2).sum(), 0.0))
    return float((products / np.maximum(norms, 1e-6)).max())


def split_songs(songs: Iterable[Song], *, seed: int = 0) -> SongSplit:
    """Songs drawn dance by dance: a fifth of each dance is tested on (R12), one song of two to seven, none of a single.

    Raises
    ------
    ValueError
        If every dance has a single song, so that none could be tested on.
    """
    labels = {song.name: song.label for song in songs}
    test: set[str] = set()
    for label in sorted({*labels.values()}):
        names = sorted(name for name, own in labels.items() if own == label)
        count = min(max(1, round(TEST_SHARE * len(names))), len(names) - 1)
        test |= {*np.random.default_rng([seed, label]).permutation(names)[:count].tolist()}
    if not test:
        fault = f"{len(labels)} songs, each of another dance"
        raise ValueError(f"{fault}: none can be tested on; two of a dance are needed")
    return SongSplit(tuple(name for name in labels if name not in test), tuple(name for name in labels if name in test))


class Attributes(Learner):
    """The attribute classifier (`AttributeClassifier`), as a thing to train."""

    result = AttributeClassifier

    @classmethod
    def learn(
        cls,
        data: list[PathLike],
        options: TrainOptions,
        *,
        preset: str = PRESETS[0],
        split_seed: int = 0,
        **changes: Any,
    ) -> None:
        """`train`, on recorded songs, of which a fifth is tested on; the outcome is noticed, too. Its own keywords:

        preset : "recommended" or "paper", of `AttributeParams`
        split_seed : int, of the songs that are tested on
        changes : other values for fields of `AttributeParams`, such as ``epochs``
        """
        params, notice = preset_settings(AttributeParams, preset, PRESETS, changes), options.notice
        songs = load_songs(data, progress=options.progress)
        for line in songs.notes:
            notice(f"left out: {line}")
        split = split_songs(songs.songs, seed=split_seed)
        notice(f"songs: {len(split.train)} train, {len(split.test)} test; dances: {', '.join(songs.classes)}")
        train_attributes(songs.songs, songs.classes, split, options, params)
        test = read_about(options.out)["meta"]["test"]
        notice(
            f"test songs: the dance of {test['right']} of {test['songs']} is named rightly; always naming the most "
            f"frequent dance of the training songs would be right for {test['majority']}"
        )
