"""A page's script run by node, on as much of a browser as it asks for."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

# Elements keep what they are given; `find` and `words` are for tests.
BROWSER = """
class Element {
    constructor(name) {
        Object.assign(this, { name, attributes: {}, children: [], listeners: {} });
    }
    get textContent() { return this.words; }
    set textContent(text) { this.children = [String(text)]; }
    append(...more) { this.children.push(...more); }
    replaceChildren(...more) { this.children = more; }
    setAttribute(key, value) { this.attributes[key] = String(value); }
    addEventListener(kind, work) { this.listeners[kind] = work; }
    focus() { document.activeElement = this; this.fire("focus"); }
    fire(kind, more = {}) {
        this.listeners[kind]?.({ preventDefault() {}, ...more });
    }
    find(test) {
        const inside = this.children.filter(x => x instanceof Element);
        return [...inside.filter(test), ...inside.flatMap(x => x.find(test))];
    }
    get words() {
        return this.children.map(x => x instanceof Element ? x.words : x).join(" ");
    }
}
const places = {};
const document = {
    createElement: name => new Element(name),
    createElementNS: (_, name) => new Element(name),
    getElementById: id => places[id] ??= new Element(id),
};
"""


def run_page(page: Path, asks: str) -> Any:
    """Run the script of an HTML page, then `asks`, which calls `answer` with a value.

    Returns the value. Its elements are in `places` by id. Skips the test where there
    is no node.
    """
    node = shutil.which("node")
    if node is None:
        pytest.skip("no node to run the page's script with")
    text = page.read_text("utf-8")
    found = re.fullmatch(
        r'.*<script type="application/json" id="data">(.*?)</script>'
        r"\s*<script>(.*?)</script>.*",
        text,
        re.DOTALL,
    )
    assert found is not None
    data, script = found.groups()
    script = "\n".join(
        [
            BROWSER,
            f'document.getElementById("data").append({json.dumps(data)});',
            "const answer = value => console.log(JSON.stringify(value));",
            script,
            f"{{ {asks} }}",
        ]
    )
    done = subprocess.run(
        [node, "-"], input=script, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)
