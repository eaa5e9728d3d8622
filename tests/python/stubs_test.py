"""The type stubs name just what the module has, and everything is documented."""

import ast
import inspect
import unittest
from pathlib import Path

import cadmorph
from cadmorph import _native

STUBS = ast.parse((Path(cadmorph.__file__).parent / "_native.pyi").read_text())


def is_public(name):
    return not name.startswith("_") or name in ("__version__", "__init__")


def names_in(body):
    names = set()
    for node in body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            names.add(node.name)
        elif isinstance(node, ast.AnnAssign):
            names.add(node.target.id)
    return {name for name in names if is_public(name)}


class Stubs(unittest.TestCase):
    def test_names_of_the_module(self):
        real = {name for name, value in vars(_native).items() if is_public(name) and not inspect.ismodule(value)}
        self.assertEqual(names_in(STUBS.body), real)
        self.assertEqual(set(cadmorph.__all__) - {"Picture", "read_parameters"} | {"__version__"}, real)

    def test_members_of_the_classes(self):
        for stub in STUBS.body:
            if not isinstance(stub, ast.ClassDef):
                continue
            cls = getattr(_native, stub.name)
            with self.subTest(stub.name):
                if issubclass(cls, Exception):
                    self.assertTrue(issubclass(cls, Exception))
                    self.assertIsInstance(cls.exit_code, int)
                    continue
                real = {name for name in vars(cls) if is_public(name)}
                if "__init__" not in names_in(stub.body):
                    real.discard("__init__")
                    with self.assertRaises(TypeError):
                        cls()
                self.assertEqual(names_in(stub.body), real)

    def test_parameters(self):
        seen = 0
        for stub in STUBS.body:
            functions = [stub] if isinstance(stub, ast.FunctionDef) else getattr(stub, "body", [])
            owner = getattr(_native, stub.name) if isinstance(stub, ast.ClassDef) else _native
            for function in functions:
                if not isinstance(function, ast.FunctionDef):
                    continue
                real = getattr(owner, function.name)
                decorators = {d.id for d in function.decorator_list}
                if isinstance(real, property) or "property" in decorators:
                    self.assertTrue(isinstance(real, property) and "property" in decorators, function.name)
                    continue
                if inspect.isfunction(real):  # written in Python
                    wanted = [a.arg for a in function.args.args + function.args.kwonlyargs]
                    self.assertEqual(list(inspect.signature(real).parameters)[1:], wanted[1:])
                    continue
                signature = inspect.getdoc(real).splitlines()[0]
                names = [a.arg for a in function.args.args + function.args.kwonlyargs if a.arg != "self"]
                for name in names:
                    self.assertIn(f"{name}:", signature, f"{stub.name}.{function.name}")
                self.assertEqual(signature.split(" -> ")[0].count(": "),
                                 len(names) + ("self: " in signature), signature)
                seen += 1
        self.assertGreater(seen, 15)

    def test_docstrings(self):
        self.assertIn("(N, 3)", cadmorph.__doc__)
        for name in cadmorph.__all__:
            self.assertTrue(getattr(cadmorph, name).__doc__, name)
        for name in ("points", "celltypes", "offsets", "connectivity"):
            self.assertRegex(getattr(cadmorph.Mesh, name).__doc__, r"int|float")


if __name__ == "__main__":
    unittest.main()
