"""What is wrong with one value, in words for whoever wrote it: pydantic speaks of tuples, dictionaries and patterns."""

from __future__ import annotations

import datetime
import re
from collections.abc import Mapping
from typing import Any, Final

from pydantic_core import ErrorDetails

from hippodrome._output import one_line

# Patterns of texts, in regular expressions and in words.
SCENARIO_NAME: Final = r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$"
METHOD_NAME: Final = r"^[A-Za-z0-9][A-Za-z0-9 ._+(),-]{0,39}$"
CLASS: Final = r"^[\w.]+:[\w.]+$"
POLICY: Final = r"(exec|stream):.*\S.*|[\w.]+:[\w.]+"  # a command that is fed step by step, or a Python object
SOURCE: Final = f"^({POLICY})$"
NEED: Final = r"^(road_network|start_pose|stereo|grain|metric_scale|[1-9][0-9]{1,3}x[1-9][0-9]{1,3})$"
PATTERNS: Final = {
    SCENARIO_NAME: "results are filed under it: letters, digits, '.', '_', '-', at most 64",
    METHOD_NAME: "a name begins with a letter or digit and has letters, digits, spaces and . _ + ( ) , - , at most 40",
    CLASS: "must be my_package.my_module:MyClass, or exec: or stream: and a command",
    SOURCE: "must be my_package.my_module:MyPolicy, or exec: or stream: and a command",
    NEED: "must be road_network, start_pose, stereo, grain, metric_scale, or a size like 640x480",
}

MUST_BE: Final = "must be "
LIST: Final = "a list, as in [a, b]"
NAMES: Final = "names with values, as in {a: b}"
KEYS: Final = "keys of its own"
TEXT: Final = "text, in quotes where it looks like a number or a word like yes"
WHOLE: Final = "a whole number"
NUMBER: Final = "a number"
TRUTH: Final = "true or false"
DATE: Final = "a date, as in 2024-05-17"
TIME: Final = "a time, as in 13:45:00, in quotes"
MOMENT: Final = "a date and time, as in 2024-05-17T13:45:00Z"
SPAN: Final = "a length of time, as in 90 (seconds)"
# What a key wants, by pydantic's names of errors; placeholders are filled with the error's context. Those that are not here
# keep pydantic's message, in which "Input should" becomes "must".
WANTED: Final = {
    "none_required": "null",
    "string_type": TEXT, "string_sub_type": TEXT, "string_unicode": TEXT, "string_not_ascii": "text of plain ASCII letters",
    "path_type": "the path of a file, in quotes where it looks like a number or a word like yes",
    "bytes_type": TEXT,
    "bool_type": TRUTH, "bool_parsing": TRUTH,
    "int_type": WHOLE, "int_parsing": WHOLE, "int_from_float": WHOLE, "int_parsing_size": "a whole number of fewer digits",
    "float_type": NUMBER, "float_parsing": NUMBER, "decimal_type": NUMBER, "decimal_parsing": NUMBER,
    "finite_number": "a finite number",
    "complex_type": NUMBER, "complex_str_parsing": NUMBER,
    "greater_than": "a number above {gt}", "greater_than_equal": "a number of at least {ge}",
    "less_than": "a number below {lt}", "less_than_equal": "a number of at most {le}",
    "multiple_of": "a multiple of {multiple_of}",
    "tuple_type": LIST, "list_type": LIST, "set_type": LIST, "frozen_set_type": LIST, "iterable_type": LIST,
    "arguments_type": LIST,
    "set_item_not_hashable": "a number, a text, true or false",
    "dict_type": NAMES, "mapping_type": NAMES,
    "model_type": KEYS, "model_attributes_type": KEYS, "dataclass_type": KEYS, "dataclass_exact_type": KEYS,
    "literal_error": "{expected}", "enum": "{expected}",
    "union_tag_invalid": "keys of which {discriminator} is one of {expected_tags}",
    "date_type": DATE, "date_parsing": DATE, "date_from_datetime_parsing": DATE, "date_from_datetime_inexact": DATE,
    "time_type": TIME, "time_parsing": TIME,
    "datetime_type": MOMENT, "datetime_parsing": MOMENT, "datetime_from_date_parsing": MOMENT, "datetime_object_invalid": MOMENT,
    "timezone_naive": f"{MOMENT}, with its time zone", "timezone_aware": "a date and time without a time zone",
    "time_delta_type": SPAN, "time_delta_parsing": SPAN,
    "is_instance_of": "a {class}", "is_subclass_of": "a class below {class}", "callable_type": "a function",
    "url_type": "an address, as in https://example.org", "url_parsing": "an address, as in https://example.org",
    "uuid_type": "a UUID in quotes", "uuid_parsing": "a UUID in quotes",
    "json_type": "text that is JSON", "json_invalid": "text that is JSON",
}  # fmt: skip
# Whole sentences, for errors of which the value itself says nothing.
SENTENCES: Final = {
    "missing": "must be given",
    "missing_argument": "must be given", "missing_keyword_only_argument": "must be given",
    "missing_positional_only_argument": "must be given",
    "too_short": "must have at least {min_length} entries, not {actual_length}",
    "too_long": "must have at most {max_length} entries, not {actual_length}",
    "string_too_short": "must have at least {min_length} characters",
    "string_too_long": "must have at most {max_length} characters",
    "bytes_too_short": "must have at least {min_length} characters",
    "bytes_too_long": "must have at most {max_length} characters",
    "union_tag_not_found": "must have the key {discriminator}, which says of which kind it is",
    "invalid_key": "must be text, as names of keys are; put it in quotes, or take it out",
    "frozen_field": "cannot be changed", "frozen_instance": "cannot be changed",
    "recursion_loop": "is a part of itself",
}  # fmt: skip
MISSING: Final = ("missing", "missing_argument", "missing_keyword_only_argument", "missing_positional_only_argument")
UNKNOWN_KEY: Final = ("extra_forbidden", "unexpected_keyword_argument")  # pydantic's names, of models and of dataclasses
MODEL_TYPES: Final = ("model_type", "model_attributes_type", "dataclass_type", "dataclass_exact_type")  # where keys are wanted
PREFIXES: Final = ("Value error, ", "Assertion failed, ")  # pydantic's, before the words of validators of ours
KINDS: Final = ((list | tuple, "a list"), (Mapping, "keys with values"), (bytes, "binary data"), (set | frozenset, "a set"))
LONGEST: Final = 60  # characters of a value that an error repeats
LONGEST_WORDS: Final = 400  # characters of what others' validators say
LARGEST_PRINTED: Final = 10**LONGEST


def words_of(one: ErrorDetails) -> str:
    """What is wrong with one value, in a sentence without the name of its key, and what it was."""
    kind = one["type"]
    if kind in UNKNOWN_KEY:
        return "unknown key"
    if kind in SENTENCES:
        return _filled(SENTENCES[kind], one)
    if kind == "string_pattern_mismatch":
        pattern = str(one.get("ctx", {}).get("pattern"))
        return f"{PATTERNS.get(pattern, f'must be text of the pattern {pattern}')}{not_given(one)}"
    if kind in WANTED:
        return f"{MUST_BE}{_filled(WANTED[kind], one)}{not_given(one)}"
    message = one["msg"]
    for prefix in PREFIXES:
        message = message.removeprefix(prefix)
    message = one_line(message.replace("Input should", "must").partition(", unable to parse")[0])[:LONGEST_WORDS]
    return f"{message}{not_given(one)}" if message.startswith("must") else message


def wanted_of(one: ErrorDetails) -> str:
    """What one of several kinds of values would be, to be joined with the others: ``a whole number``."""
    if one["type"] in WANTED:
        return _filled(WANTED[one["type"]], one)
    return words_of({**one, "input": ...}).removeprefix(MUST_BE)


def not_given(one: Mapping[str, Any]) -> str:
    """What was given instead, in few words: ``, not 5``; empty where it cannot be said."""
    given = one.get("input")
    if given is None:
        return ", not null (empty): give it a value, or leave the key out"
    if isinstance(given, bool):
        return f", not {str(given).lower()}"
    if isinstance(given, int) and abs(given) > LARGEST_PRINTED:  # Python refuses to print what has thousands of digits
        return ""
    if isinstance(given, str | int | float):
        return f", not {repr(given)[:LONGEST]}"
    if isinstance(given, datetime.date):  # a datetime is one, too
        return f", not the date {given}, which quotes make a text"
    return next((f", not {words}" for kind, words in KINDS if isinstance(given, kind)), "")


def _filled(words: str, one: ErrorDetails) -> str:
    """Words with the limits, names and lengths of an error in them."""
    context = {name: f"{value:.15g}" if isinstance(value, float) else value for name, value in one.get("ctx", {}).items()}
    if context.get("actual_length", "") is None:  # of what has no end
        context["actual_length"] = "more"
    try:
        return words.format_map(context)
    except (KeyError, ValueError):  # an error that does not say what it is about
        return re.sub(r"\{\w+\}", "...", words)
