"""The schema of files, made once: checking it anew for each file takes longer than what is tested."""

from functools import cache

import jsonschema

import steadyslip as ss


@cache
def file_schema() -> jsonschema.Draft202012Validator:
    return jsonschema.Draft202012Validator(ss.json_schema())
