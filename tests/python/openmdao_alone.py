"""openmdao.api as `om`, also of a copy that lacks its pictures; None where there is no OpenMDAO."""

import importlib.abc
import importlib.machinery
import sys
import types


class NoPictures(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Finds what is missing of openmdao.visualization: functions that do nothing."""

    def find_spec(self, name, path, target=None):
        if name.startswith("openmdao.visualization"):
            return importlib.machinery.ModuleSpec(name, self, is_package=True)
        return None

    def create_module(self, spec):
        module = types.ModuleType(spec.name)

        def anything(name):
            if name.startswith("__"):
                raise AttributeError(name)
            return lambda *args, **named: None

        module.__getattr__ = anything
        return module

    def exec_module(self, module):
        pass


sys.meta_path.append(NoPictures())
try:
    import openmdao.api as om
except ImportError:
    om = None
