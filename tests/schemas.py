"""Checks files against the JSON Schemas in docs/schemas with an independent validator: the built-in
files follow them, and misspelt fields and wrong types do not. Needs Python 3.11 and jsonschema.

    python3 tests/schemas.py
"""

import json
import pathlib
import sys
import tomllib

import jsonschema

ROOT = pathlib.Path(__file__).parents[1]
FOLDERS = {
    "profile": "device-profiles",
    "scene": "device-profiles/scenes",
    "station": "device-profiles/stations",
    "patient": "device-profiles/patients",
    "faults": "device-profiles/faults",
    "dialect": "device-profiles/dialects",
}
# Kind of file, text, and whether it follows its schema.
CASES = [
    ("profile", "extends = 'webcam-grey'\nname = 'own'\n[camera]\nf_number = 2", True),
    ("profile", "extends = 'webcam-grey'\nname = 'own'\n[camera]\nf_nmber = 2", False),
    ("profile", "extends = 3\nname = 'own'", False),
    ("scene", "name = 'a'\n[[object]]\nshape = { kind = 'sphere', radius_mm = 3 }", True),
    ("scene", "name = 'a'\n[[object]]\nshape = { kind = 'sphere', radius = 3 }", False),
    ("scene", "name = 'a'\n[[object]]\nshape = { kind = 'ball', radius_mm = 3 }", False),
    ("scene", "name = 'a'\n[[object]]\nshape = { kind = 'couch' }\nposition_mm = [1, 2]", False),
    (
        "manifest",
        "[projector]\nwidth_px = 640\nheight_px = 480\n[[frame]]\nfile = 'a.png'\n"
        "pattern = { kind = 'fringe', axis = 'x', period_px = 16, phase_rad = 0 }",
        True,
    ),
    (
        "manifest",
        "[projector]\nwidth_px = 640\nheight_px = 480\n[[frame]]\n"
        "pattern = { kind = 'fringe-set', axis = 'x', period_px = 16, steps = 4 }",
        True,
    ),
    ("manifest", "[projector]\nwidth_px = 640\nheight_px = 480", False),
]


def main():
    failed = 0
    checked = 0

    def check(validator, document, follows, place):
        nonlocal failed, checked
        checked += 1
        errors = [f"{error.json_path}: {error.message}" for error in validator.iter_errors(document)]
        if (not errors) != follows:
            failed += 1
            print(f"not ok {place}: expected {'no errors' if follows else 'an error'}, found {errors}")

    validators = {}
    for path in sorted((ROOT / "docs/schemas").glob("*.schema.json")):
        schema = json.loads(path.read_text())
        jsonschema.Draft7Validator.check_schema(schema)
        validators[path.name.removesuffix(".schema.json")] = jsonschema.Draft7Validator(schema)
    for kind, folder in FOLDERS.items():
        paths = [p for p in sorted((ROOT / folder).glob("*.toml")) if p.name != "Cargo.toml"]
        assert paths, f"{folder}: no files"
        for path in paths:
            document = tomllib.loads(path.read_text())
            check(validators[kind], document, True, path.name)
            check(validators[kind], document | {"colour": 3}, False, f"{path.name} with a colour")
            first = next(iter(document))
            check(validators[kind], document | {first: True}, False, f"{path.name}: {first} = true")
    for kind, text, follows in CASES:
        check(validators[kind], tomllib.loads(text), follows, f"{kind}: {text!r}")
    print(f"{checked} documents checked, {failed} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
