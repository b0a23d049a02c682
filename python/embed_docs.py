#!/usr/bin/env python3
"""Makes C++ of the docstrings of a type stub, so that help() and editors say the same.

    embed_docs.py STUB OUTPUT
"""
import ast
import inspect
import pathlib
import sys


def signature(function):
    """As a person would write it: without self and without annotations of what is returned."""
    arguments = ast.unparse(function.args)
    for first in ("self, ", "self"):
        if arguments.startswith(first):
            arguments = arguments[len(first):]
            break
    returned = f" -> {ast.unparse(function.returns)}" if function.returns else ""
    return f"{function.name}({arguments}){returned}"


def plain_signature(function):
    """As inspect.signature() reads it of a built-in function: with self and without annotations."""
    arguments = function.args
    for one in (*arguments.args, *arguments.kwonlyargs, arguments.vararg, arguments.kwarg):
        if one is not None:
            one.annotation = None
    return f"{function.name}({ast.unparse(arguments)})\n--\n\n"


def docs(body, before=""):
    """(qualified name, text) of what has a docstring."""
    for node in body:
        if not isinstance(node, (ast.ClassDef, ast.FunctionDef)):
            continue
        text = ast.get_docstring(node, clean=False)
        text = inspect.cleandoc(text) if text else ""
        is_property = any(isinstance(d, ast.Name) and d.id == "property" for d in getattr(node, "decorator_list", ()))
        if isinstance(node, ast.FunctionDef) and not is_property:
            text = (signature(node) + "\n\n" + text).strip()
            text = plain_signature(node) + text
        if text:
            yield before + node.name, text
        if isinstance(node, ast.ClassDef):
            yield from docs(node.body, before + node.name + ".")


def main():
    stub, output = map(pathlib.Path, sys.argv[1:])
    lines = [
        f"// Made of {stub.name} by embed_docs.py.",
        "#include <python/docs.h>",
        "namespace palpate::python {",
        "const std::vector<std::pair<const char*, const char*>>& docs()",
        "{",
        "    static const std::vector<std::pair<const char*, const char*>> all{",
    ]
    for name, text in docs(ast.parse(stub.read_text(encoding="utf-8")).body):
        lines.append(f'        {{"{name}", R"docs({text})docs"}},')
    lines += ["    };", "    return all;", "}", "}  // namespace palpate::python", ""]
    output.write_text("\n".join(lines), encoding="utf-8")


if __name__ == "__main__":
    main()
