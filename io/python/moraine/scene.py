"""Python values as the text of a scene file, so that keys, checks and messages are those of scene files."""

import json
import math
import numbers
from collections.abc import Mapping


def toml_value(value, key):
    """One value as TOML on one line. `key` stands in the message of a TypeError."""
    if hasattr(value, "tolist"):  # numpy
        value = value.tolist()
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, numbers.Integral):
        return str(int(value))
    if isinstance(value, numbers.Real):
        value = float(value)
        if math.isfinite(value):
            return repr(value)
        return "nan" if value != value else ("inf" if value > 0 else "-inf")
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if hasattr(value, "__fspath__"):
        return toml_value(value.__fspath__(), key)
    if isinstance(value, Mapping):
        members = (f"{toml_key(name)} = {toml_value(member, f'{key}.{name}')}" for name, member in value.items())
        return "{ " + ", ".join(members) + " }" if value else "{}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(toml_value(item, f"{key}[{i}]") for i, item in enumerate(value)) + "]"
    raise TypeError(f'key "{key}": a {type(value).__name__} cannot stand in a scene; expected a number, a text, true or false, '
                    "or a list or dict of these")


def toml_key(name):
    if not isinstance(name, str):
        raise TypeError(f"keys of a scene are texts, found {name!r}")
    is_bare = name.isascii() and name.replace("_", "").replace("-", "").isalnum()
    return name if is_bare else toml_value(name, name)


def is_tables(value):
    return isinstance(value, (list, tuple)) and len(value) > 0 and all(isinstance(item, Mapping) for item in value)


def document(scene):
    """A whole scene: values first, then [sections] and [[lists of sections]], whose headers end what stands above them."""
    plain, sections = [], []
    for name, value in scene.items():
        header = toml_key(name)
        if isinstance(value, Mapping):
            sections.append(section(f"[{header}]", value, name))
        elif is_tables(value):
            sections += [section(f"[[{header}]]", item, f"{name}[{i}]") for i, item in enumerate(value)]
        else:
            plain.append(f"{header} = {toml_value(value, name)}\n")
    return "".join(plain) + "".join(sections)


def section(header, values, key):
    lines = (f"{toml_key(name)} = {toml_value(value, f'{key}.{name}')}\n" for name, value in values.items())
    return f"\n{header}\n" + "".join(lines)


def overrides(changes):
    """{"time.end": 2.0} or ["time.end=2.0"] as the command line has them."""
    if isinstance(changes, Mapping):
        return [f"{key}={toml_value(value, key)}" for key, value in changes.items()]
    return list(changes or ())
