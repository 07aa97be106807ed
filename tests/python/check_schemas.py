"""JSON Schemas of `beadline schema`, against files that the program takes and wrong ones.

    python check_schemas.py BEADLINE ROOT      works in this directory
"""

import json
import random
import re
import subprocess
import sys
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from jsonschema import Draft202012Validator

KINDS = ["run", "sweep", "orbit"]
WANTED = 200
PROGRAM, ROOT = sys.argv[1], Path(sys.argv[2])


def beadline(*words):
    return subprocess.run([PROGRAM, *words], capture_output=True, text=True)


def examples(kind):
    """The examples of a command, whose names its refusal of another name gives."""
    names = beadline(kind, "--example", "?").stderr.split("there are: ")[1].split()
    return [(kind, beadline(kind, "--example", name.strip(",")).stdout) for name in names]


def whole_files():
    """Kind and text of presets, examples, and chains that are tested elsewhere."""
    presets = [line.split()[0] for line in beadline("presets").stdout.splitlines()]
    files = [("run", beadline("preset", name).stdout) for name in presets]
    for name in ["driven-state-cases", "bath-cases"]:
        files += [("run", case["toml"]) for case in json.loads((ROOT / f"tests/reference/{name}.json").read_text())]
    return files + examples("sweep") + examples("orbit")


def documented():
    """Page and text of each block of TOML in the documentation."""
    for page in [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]:
        text = page.read_text()
        for block in re.findall(r"```toml\n(.*?)```", text, re.S):
            yield page, block
        for _, block in re.findall(r"cat > \S+\.toml <<'(\w+)'\n(.*?)\n\1\n", text, re.S):
            yield page, block


def toml(value):
    """A value of TOML in one line."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(key)} = {toml(inner)}" for key, inner in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    return json.dumps(value, ensure_ascii=False)


def places(value):
    """Each table, and each place of a value that is none: what it lies in, and its key there."""
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else []
    for key, below in inner:
        if isinstance(below, dict):
            yield below, None
        elif not isinstance(below, list):
            yield value, key
        yield from places(below)


def changed(document, numbers):
    """A copy of a document with one change, and a word for it."""
    copy = json.loads(json.dumps(document))
    # a value that other tables replace may be anything
    others = json.dumps([copy.get(table) for table in ["grid", "case", "sample", "continue"]])
    replaced = set(re.findall(r"\w+", others)) - {"from", "to", "count", "key"}
    within, key = numbers.choice([(copy, None), *(place for place in places(copy) if place[1] not in replaced)])
    if key is None:
        within["colour"] = 1
        return copy, "unknown key"
    old = within[key]
    if isinstance(old, str):
        within[key], word = numbers.choice([("nonsense", "word"), (7, "type")])
    elif isinstance(old, bool):
        within[key], word = "x", "type"
    else:
        within[key], word = numbers.choice([("x", "type"), (True, "type"), (-1, "range"), (0, "range"), (1e200, "range")])
    return copy, word


def is_refused(kind, name, document):
    """True if the program refuses the file."""
    Path(f"{name}.toml").write_text("".join(f"{key} = {toml(value)}\n" for key, value in document.items()))
    words = {
        "run": ["run", f"{name}.toml", "--dry-run"],
        "sweep": ["sweep", f"{name}.toml", "--out", name, "--merge"],
        "orbit": ["orbit", f"{name}.toml", "--out", name],
    }
    ended = beadline(*words[kind])
    assert kind == "sweep" or ended.returncode in [0, 2], (document, ended.stderr)
    return ended.returncode == 2


def main():
    validators = {}
    for kind in KINDS:
        schema = json.loads(beadline("schema", kind).stdout)
        Draft202012Validator.check_schema(schema)
        validators[kind] = Draft202012Validator(schema)
    files = [(kind, tomllib.loads(text)) for kind, text in whole_files()]
    for kind, document in files:
        errors = [f"{error.json_path}: {error.message}" for error in validators[kind].iter_errors(document)]
        assert not errors, (document, errors)
    blocks = [(page, tomllib.loads(text)) for page, text in documented()]
    # a crate of one's own is no file of ours
    blocks = [(page, document) for page, document in blocks if "dependencies" not in document]
    for page, document in blocks:
        # a part of a file lacks what the whole one needs
        errors = {kind: [e for e in of.iter_errors(document) if e.validator != "required" or e.path] for kind, of in validators.items()}
        said = {kind: [f"{e.json_path}: {e.message}" for e in of] for kind, of in errors.items()}
        assert not all(errors.values()), (page.name, document, said)

    numbers = random.Random(1)

    def trial(index):
        kind, (document, word) = drawn[index]
        by_schema = not validators[kind].is_valid(document)
        # an orbit that is none of the wrong ones would be computed
        by_program = is_refused(kind, f"wrong-{index}", document) if by_schema or kind != "orbit" else None
        assert by_program or not by_schema, (kind, word, document, [e.message for e in validators[kind].iter_errors(document)])
        return word, by_schema, by_program

    wrong = {}
    small = {kind: [document for of, document in files if of == kind and len(json.dumps(document)) < 4000] for kind in KINDS}
    kinds = numbers.choices(KINDS, [3, 1, 1], k=WANTED * 3 // 2)
    drawn = [(kind, changed(numbers.choice(small[kind]), numbers)) for kind in kinds]
    with ThreadPoolExecutor(4) as pool:
        for word, by_schema, by_program in pool.map(trial, range(len(drawn))):
            both, alone = wrong.get(word, (0, 0))
            wrong[word] = (both + by_schema, alone + (by_program is True and not by_schema))
    total, alone = (sum(column) for column in zip(*wrong.values()))
    parts = ", ".join(f"{word} {both} + {alone}" for word, (both, alone) in sorted(wrong.items()))
    print(f"{len(files)} files and {len(blocks)} blocks are valid; {total} wrong ones are refused by schema and program, {alone} by the program alone ({parts})")
    assert total >= WANTED, wrong


if __name__ == "__main__":
    main()
