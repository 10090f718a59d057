"""Formulas as docstrings write them, ``x'' = K (g - x) - D x'``, in the language of TeX.

What is read is what the docstrings use: symbols of one letter with indices, Greek letters by name, sums, functions.
Of anything else, as code, `to_tex` says that it is no formula.
"""

from __future__ import annotations

import re
from itertools import accumulate

_GREEK = (
    "alpha beta gamma delta epsilon eta theta kappa lambda mu nu xi pi rho sigma tau phi psi omega Phi Psi Omega Sigma"
)
_FUNCTIONS = "exp log ln max min sin cos tan arccos det"
_WORDS = {"mean": r"\operatorname{mean}", "trace": r"\operatorname{trace}"}
_WORDS |= {"lam": r"\lambda ", "integral": r"\int ", "conj": r"\operatorname{conj}", "cot": r"\cot "}
_WORDS |= {"atan": r"\operatorname{atan}"}
_WORDS |= {name: rf"\{name} " for name in f"{_GREEK} {_FUNCTIONS} sqrt sum".split()}
_SIGNS = {
    "<=": r"\le ", ">=": r"\ge ", "->": r"\to ", "~": r"\sim ", "*": r"\cdot ", "·": r"\cdot ", "×": r"\times ",
    "Σ": r"\sum ", "σ": r"\sigma ", "τ": r"\tau ", "π": r"\pi ", "²": "^2", "⋆": "^{*}", "∫": r"\int ",
    "∞": r"\infty ", "≤": r"\le ", ",": r",\ ",
}  # fmt: skip
#: What opens a group -> what closes it, and both in TeX. Bars are told apart before.
_GROUPS = {
    "(": (")", "(", ")"),
    "[": ("]", "[", "]"),
    "⟦": ("⟧", r"\lVert ", r"\rVert "),
    "⟪": ("⟫", r"\lvert ", r"\rvert "),
}
_ENDS_A_TERM = ("+", "-", "=", ",", "<", ">", "<=", ">=", "->", "~")
#: An index of a lower-case name, a keyword with its value, and functions with a name of their own, as ``max_angle``.
_IS_CODE = re.compile(r"[a-z]\[|\w=\S|\b(?:max|min)_|\bsum\(")
_TOKEN = re.compile(
    r"(?P<space>\s*)(?:(?P<dots>\.\.\.)|“(?P<text>[a-z]+)”|(?P<number>\d+(?:\.\d+)?)|(?P<word>[A-Za-z]+)(?P<digits>\d+)?(?P<primes>'*)"
    r"|_(?P<index>[A-Za-z0-9]+)|(?P<sign><=|>=|->|[-+=/*^<>,~Σστπ²⋆∫∞≤·×])|(?P<open>[(\[⟦⟪])|(?P<close>[)\]⟧⟫]))"
)


class NoFormulaError(ValueError):
    """The text is something else, as code."""


def to_tex(formula: str, words: bool = False) -> str:
    """A formula for TeX; with `words` in it, such as ``angle between r and v``, if it is known to be one.

    Raises
    ------
    NoFormulaError
        It holds a word that is no symbol, or a sign that formulas do not have.
    """
    text = re.sub(r"(?<!\.)\.$", "", formula.strip())
    text = re.sub(r"\|([^|]*)\|", r"⟪\1⟫", re.sub("‖([^‖]*)‖", r"⟦\1⟧", text))
    text = re.sub(r"(?<=\w)\*(?![ \w])", "⋆", re.sub(r"\^(-\d+|\d\d+)", r"^(\1)", text))
    if _IS_CODE.search(text):
        raise NoFormulaError(formula)
    if words:
        text = re.sub(r"(?<![_a-zA-Z])[a-z]{3,}(?![a-z])", _symbol_or_text, text)
    tokens, at = [], 0
    while at < len(text):
        if (found := _TOKEN.match(text, at)) is None:
            raise NoFormulaError(formula)
        tokens.append(found)
        at = found.end()
    tex, remaining = _sequence(tokens)
    if remaining or not tex:
        raise NoFormulaError(formula)
    tex = re.sub(r" \}(?=$|[_^)},])", "}", re.sub(r"(^|[({=])\\text\{ ", r"\1\\text{", tex))
    return tex.strip()


def _symbol_or_text(word: re.Match[str]) -> str:
    return word[0] if word[0] in _WORDS else f"“{word[0]}”"


def _sequence(tokens: list[re.Match[str]]) -> tuple[str, list[re.Match[str]]]:
    """Terms up to what closes the group, and the tokens left; ``a / b`` with spaces around it becomes a fraction."""
    done, term, above = "", "", None
    while tokens and not tokens[0]["close"]:
        token, *tokens = tokens
        if token["open"]:
            group, tokens = _group(token["open"], tokens, term)
            term = term.removesuffix("^").removesuffix(r"\sqrt ") + group
        elif token["sign"] == "/" and token["space"] and term and above is None:
            above, term = term, ""
        elif token["sign"] in _ENDS_A_TERM:
            done += _fraction(above, term) + _SIGNS.get(token["sign"], token["sign"])
            term, above = "", None
        else:
            term += _one(token)
    return done + _fraction(above, term), tokens


def _group(opened: str, tokens: list[re.Match[str]], before: str) -> tuple[str, list[re.Match[str]]]:
    """What stands in parentheses or bars, with them; behind a power or a root without."""
    closes, left, right = _GROUPS[opened]
    inside, tokens = _sequence(tokens)
    if not tokens or tokens[0]["close"] != closes:
        raise NoFormulaError(opened)
    if before.endswith("^"):
        return f"^{{{inside}}}", tokens[1:]
    if before.endswith(r"\sqrt "):
        return rf"\sqrt{{{inside}}}", tokens[1:]
    tall = r"\frac" in inside
    return (rf"\left{left}{inside}\right{right}" if tall else f"{left}{inside}{right}"), tokens[1:]


def _fraction(above: str | None, below: str) -> str:
    return below if above is None else rf"\frac{{{_bare(above)}}}{{{_bare(below)}}}"


def _bare(text: str) -> str:
    """Without the parentheses around all of it."""
    found = re.fullmatch(r"(?:\\left)?\((.*?)(?:\\right)?\)", text)
    depths = list(accumulate({"(": 1, ")": -1}.get(sign, 0) for sign in text))
    return found[1] if found and min(depths[text.index("(") : -1]) > 0 else text


def _one(token: re.Match[str]) -> str:
    if token["dots"]:
        return r"\dots "
    if token["text"]:
        return rf"\text{{ {token['text']} }}"
    if token["number"]:
        return token["number"]
    if token["index"]:
        return f"_{{{_index(token['index'])}}}"
    if token["sign"]:
        return _SIGNS.get(token["sign"], token["sign"])
    word, digits = token["word"], token["digits"]
    if len(word) == 2 and word[0] == "d":  # a differential
        word = rf"\mathrm{{d}}{word[1]}"
    elif len(word) > 1 and word not in _WORDS:
        raise NoFormulaError(word)
    return _WORDS.get(word, word) + (f"_{{{digits}}}" if digits else "") + token["primes"]


def _index(text: str) -> str:
    return _WORDS.get(text, text if len(text) < 3 else rf"\mathrm{{{text}}}")
