"""Files that a reader picks in notebook 13."""

from datetime import UTC, datetime
from pathlib import Path

import pytest

from harmolab.lab.labs.one_clip import OwnFiles


def upload(files: OwnFiles, kind: str, name: str, content: bytes = b"bytes") -> None:
    facts = {"name": name, "type": "", "size": len(content), "last_modified": datetime(2026, 1, 1, tzinfo=UTC)}
    files._rows[kind][0].value = ({**facts, "content": content},)


def test_nothing_picked_is_nothing():
    files = OwnFiles()
    assert (files.song, files.dance) == (None, None)


@pytest.mark.parametrize("name", ["my song.WAV", "../../song.wav", "/etc/passwd.wav", "a\x00b.wav", "<b>.wav"])
def test_an_upload_is_kept_under_a_name_of_ours(name: str):
    files = OwnFiles()
    upload(files, "dance", "dance.bvh")
    upload(files, "song", name, b"planted")
    assert (files.song.name, files.song.parent) == ("song.wav", Path(files._folder.name))
    assert files.song.read_bytes() == b"planted"


@pytest.mark.parametrize("name", ["", "song", ".wav", "song.w/av", "song.a b", "song." + "a" * 99, "song.wäv"])
def test_an_upload_without_a_plain_ending_is_refused(name: str):
    files = OwnFiles()
    upload(files, "song", name)
    with pytest.raises(ValueError, match=r"the song needs a name that ends in its format"):
        _ = files.song


@pytest.mark.parametrize("quote", ["", '"', "'"])  # Windows copies a path in quotes
def test_of_upload_and_path_the_last_one_counts_and_words_name_it(tmp_path: Path, quote: str):
    _, line, words = (files := OwnFiles())._rows["dance"]
    assert words.value == "none yet; over 10 MB only by its path"
    upload(files, "dance", "first.mp4")
    assert words.value == "first.mp4 is taken"
    line.value = f"  {quote}{tmp_path / 'my film.mp4'}{quote} "
    assert files.dance == tmp_path / "my film.mp4" and "my film.mp4" in words.value
    upload(files, "dance", "second.mov")
    assert (files.dance.name, words.value) == ("dance.mov", "second.mov is taken")


@pytest.mark.parametrize(("there", "name", "missing"), [("dance", "d.bvh", "song"), ("song", "s.wav", "dance")])
def test_one_of_the_two_alone_is_never_joined_with_the_example(there: str, name: str, missing: str):
    upload(files := OwnFiles(), there, name)
    for either in ("song", "dance"):
        with pytest.raises(ValueError, match=f"a {there} arrived, and no {missing}: pick one"):
            getattr(files, either)


def test_a_video_alone_is_its_own_song():
    files = OwnFiles()
    upload(files, "dance", "me.MP4")
    assert files.song == files.dance == Path(files._folder.name) / "dance.mp4"
    upload(files, "song", "song.wav")
    assert files.song.name == "song.wav"


def test_page_without_widgets_says_where_files_are_picked():
    assert OwnFiles()._repr_mimebundle_()["text/plain"] == "pick your files in JupyterLab"
