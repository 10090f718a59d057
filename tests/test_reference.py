"""The page of public names is what the table of names and the docstrings say."""

import re

from make_reference import MODULES, PAGE, reference

import kineme


def test_the_page_is_the_table_of_names():
    assert PAGE.read_text(encoding="utf-8") == reference(), "run make reference"


def test_every_name_is_explained():
    rows = re.findall(r"^\| (.+?) \| (.*?) \| (.+?) \|$", reference(), re.MULTILINE)
    explained = {name.strip("[`").partition("`")[0] for name, meaning, _ in rows if meaning.strip()}
    assert {name for module in MODULES for name in module.__all__} <= explained


def test_what_a_stream_is_and_says_has_public_names():
    for stream in (kineme.Recognizer.stream, kineme.ActionLibrary.stream):
        assert stream.__annotations__["return"] in kineme.recognition.__all__
    assert kineme.recognition.Live.update.__annotations__["return"] in kineme.recognition.__all__
