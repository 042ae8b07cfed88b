"""The type stubs name what there is, and everything that there is says what it is."""

import ast
import pathlib
import re
import unittest

import support  # noqa: F401
import traceflow as tf

STUBS = pathlib.Path(tf.__file__).resolve().parent


def parameters_of(documented):
    """The names in the first line of a function's text, which pybind11 writes."""
    signature = re.match(r"\w+\((.*)\) -> ", documented.__doc__.splitlines()[0], re.DOTALL).group(1)
    names, depth, start = [], 0, 0
    for i, letter in enumerate(signature + ","):
        depth += (letter in "([{<") - (letter in ")]}>")
        if letter == "," and depth == 0:
            name = re.match(r"[*\w]*", signature[start:i].strip()).group(0)
            names.append(name)
            start = i + 1
    return [name for name in names if name not in ("", "*")]


def parameters_in(stub):
    arguments = stub.args
    names = [a.arg for a in arguments.posonlyargs + arguments.args + arguments.kwonlyargs]
    return names + (["**" + arguments.kwarg.arg] if arguments.kwarg else [])


def is_public(name):
    return not name.startswith("_") or name in ("__init__", "__getitem__", "__setitem__", "__len__")


class Stubs(unittest.TestCase):
    def check_function(self, where, stub, found):
        wanted = parameters_in(stub)
        actual = parameters_of(found)
        # Keywords of any name have one of their own in each.
        wanted, actual = ([n for n in names if not n.startswith("**")] for names in (wanted, actual))
        unnamed = [n for n in actual if re.fullmatch(r"arg\d+", n)]
        self.assertEqual(len(wanted), len(actual), where)
        if not unnamed:
            self.assertEqual(wanted, actual, where)

    def check_class(self, where, stub, found, bases):
        stubbed = {}
        for base in [bases[b.id] for b in stub.bases if isinstance(b, ast.Name) and b.id in bases] + [stub]:
            for item in base.body:
                if isinstance(item, ast.FunctionDef):
                    stubbed[item.name] = item
                elif isinstance(item, ast.AnnAssign):
                    stubbed[item.target.id] = item
        for name in vars(found):
            if is_public(name) and not name.startswith("__"):
                self.assertIn(name, stubbed, where)
                self.assertTrue(vars(found)[name].__doc__, f"{where}.{name} says what it is")
        for name, item in stubbed.items():
            if name == "__hash__":
                continue
            self.assertTrue(hasattr(found, name), f"{where}.{name}")
            is_property = isinstance(item, ast.AnnAssign) or any(
                isinstance(d, ast.Name) and d.id == "property" or isinstance(d, ast.Attribute)
                for d in item.decorator_list)
            if not is_property and is_public(name):
                static = any(isinstance(d, ast.Name) and d.id == "staticmethod" for d in item.decorator_list)
                if name == "set" or (name == "__init__" and found is tf.Video):
                    continue
                function = getattr(found, name)
                wanted = ["self"] * static + parameters_in(item)
                actual = ["self"] * static + parameters_of(function)
                self.assertEqual(len([n for n in wanted if "**" not in n]), len([n for n in actual if "**" not in n]),
                                 f"{where}.{name}")

    def check_module(self, file, module):
        tree = ast.parse(file.read_text())
        bases = {item.name: item for item in tree.body if isinstance(item, ast.ClassDef)}
        stubbed = {item.name: item for item in tree.body if isinstance(item, (ast.ClassDef, ast.FunctionDef))}
        for name, found in vars(module).items():
            if not is_public(name) or name.startswith("__") or isinstance(found, type(tf)):
                continue
            self.assertIn(name, stubbed, file)
            self.assertTrue(found.__doc__, f"{name} says what it is")
        for name, item in stubbed.items():
            if name.startswith("_"):
                continue
            self.assertTrue(hasattr(module, name), f"{file}: {name}")
            if isinstance(item, ast.FunctionDef):
                self.check_function(f"{file.stem}.{name}", item, getattr(module, name))
            elif not issubclass(getattr(module, name), Exception):
                self.check_class(f"{file.stem}.{name}", item, getattr(module, name), bases)

    def test_they_name_what_there_is(self):
        self.check_module(STUBS / "__init__.pyi", tf)
        self.check_module(STUBS / "metrics.pyi", tf.metrics)
        files = sorted((STUBS / "ops").glob("[a-z]*.pyi"))
        self.assertEqual([f.stem for f in files], sorted(n for n in vars(tf.ops) if not n.startswith("_")))
        for file in files:
            self.check_module(file, getattr(tf.ops, file.stem))

    def test_submodules_can_be_imported(self):
        import traceflow.ops.raster

        self.assertIs(traceflow.ops.raster, tf.ops.raster)

    def test_version_is_that_of_the_program(self):
        self.assertRegex(tf.__version__, r"^\d+\.\d+\.\d+$")


if __name__ == "__main__":
    unittest.main()
