"""heft: estimation and control of robot arms, from a log to firmware.

Every question is one call of heft's library; the numbers are those of the command.

>>> import heft
>>> fit = heft.identify("ur5e", "train.csv", validate="judge.csv")
>>> print(fit.brief())
>>> fit.save("arm.json"); fit.report("arm.html")

Logs are paths, `heft.Log` objects, pandas data frames with heft's column names, or a list of these. SI units.
"""
import json as _json
import os as _os
import pathlib as _pathlib

# Robots by name come with the package.
_robots = _pathlib.Path(__file__).parent / "urdf"
if _robots.is_dir():
    _os.environ.setdefault("HEFT_URDF_PATH", str(_robots))

from . import _heft
from ._heft import DataError, Error, InputError, Log, ModelError, NotIdentifiableError, Robot, Sums, UrdfError, robot_names
from ._logs import log_of as _log_of, read_log

__all__ = ["Answer", "DataError", "Error", "InputError", "LiveLoad", "Log", "ModelError", "NotIdentifiableError", "Robot",
           "Sums", "UrdfError", "diagnose", "excite", "fleet", "identify", "merge", "payload", "read_log", "read_sums",
           "robot_names", "simulate", "stiffness", "sums", "validate"]

Answer = _heft.Answer


def _to_dict(self):
    """Results as a dictionary; fields as in tools/README.md."""
    return _json.loads(self.json())


Answer.to_dict = _to_dict
Answer.__str__ = lambda self: self.full()
Answer.__repr__ = lambda self: f"<heft.{self.kind}: {self.brief()}>"
Answer._repr_html_ = lambda self: f'<iframe srcdoc="{_escaped(self.html())}" width="100%" height="700"></iframe>'


def _escaped(html):
    return html.replace("&", "&amp;").replace('"', "&quot;")


def _robot(robot):
    return robot if isinstance(robot, Robot) else Robot(str(robot))


def _logs(logs):
    if logs is None:
        return []
    return [_log_of(log) for log in (logs if isinstance(logs, (list, tuple)) else [logs])]


def _numbers(values):
    return [] if values is None else [float(values)] if isinstance(values, (int, float)) else [float(v) for v in values]


def identify(robot, logs, *, validate=None, method="wls", split=0.7, torque_at="motor", band=0.0, torque_constant=None,
             accept_torque=False, progress=None):
    """Fits a model to logs, judged on logs that it has not seen.

    robot: `Robot`, a URDF's path, or a name such as "ur5e". logs: or the `Sums` of logs, with the settings that these were
    made with (no irls, no iv). method: ols, wls, irls, iv, tls, physical. split: of a single log without `validate`, the part
    that is fitted to. progress: called with what is being done and its share, 0 to 1.
    Raises NotIdentifiableError with the motion that is missing, DataError for a log that cannot be used.
    """
    if isinstance(logs, Sums):
        return _heft.identify_sums(_robot(robot), logs, _logs(validate), method, band, _numbers(torque_constant), accept_torque,
                                   progress)
    return _heft.identify(_robot(robot), _logs(logs), _logs(validate), method, split, torque_at, band,
                          _numbers(torque_constant), accept_torque, progress)


def sums(robot, logs, *, torque_at="motor", band=0.0, torque_constant=None, accept_torque=False, progress=None):
    """What a fit needs of logs, in place of them: to be pickled, sent to another process, merged and given to `identify`.

    Merged with + or `merge` in whatever order, the parameters agree to 1e-10 and the intervals with them.
    """
    return _heft.sums(_robot(robot), _logs(logs), torque_at, band, _numbers(torque_constant), accept_torque, progress)


def merge(parts):
    """The sums of all parts. Raises DataError when a log is in two of them, or they are of different robots."""
    parts = iter(parts)
    whole = next(parts, None)
    if whole is None:
        raise InputError("merge: found no sums; expected at least one")
    for part in parts:
        whole = whole + part
    return whole


def read_sums(path):
    """Sums that `Sums.save` wrote."""
    return _heft.read_sums(_os.fspath(path))


def fleet(fits):
    """Which arms of one type differ from the rest, and in which parameter.

    fits: a dictionary from the name of each arm to what `identify` found in its logs, or to its model file. Five at least.
    """
    return _heft.fleet([(str(name), _model(fit)) for name, fit in fits.items()])


def _model(fit):
    return fit.robot if isinstance(fit, Answer) else _robot(fit)


def validate(robot, logs, *, torque_at=None, band=0.0, torque_constant=None, accept_torque=False, progress=None):
    """Judges a model (a `Robot` of a model file) on logs that it was not fitted to."""
    return _heft.validate(_robot(robot), _logs(logs), torque_at, band, _numbers(torque_constant), accept_torque, progress)


def diagnose(robot, logs, *, validate=None, split=0.7, torque_at="motor", band=0.0, cutoff=0.0, refit=True,
             torque_constant=None, accept_torque=False, progress=None):
    """Finds the effects that a model of rigid bodies and friction lacks, adds them, judges both on other logs.

    The model written is then fitted to all logs, those judged on too, where that lowers the errors (`refit`).
    """
    return _heft.diagnose(_robot(robot), _logs(logs), _logs(validate), split, torque_at, band, cutoff, refit,
                          _numbers(torque_constant), accept_torque, progress)


def payload(robot, logs, *, baseline=None, zero=None, first_joint=1, torque_at="motor", band=0.0, torque_constant=None,
            accept_torque=False, progress=None):
    """What the arm carries in each log: by a model file of the arm without load, or by a baseline log to fit one to."""
    return _heft.payload(_robot(robot), _logs(logs), _logs(baseline), _logs(zero), first_joint, torque_at, band,
                         _numbers(torque_constant), accept_torque, progress)


def excite(robot, *, duration=20.0, harmonics=5, seed=1, rehearse=True, progress=None):
    """Designs an exciting motion inside the arm's limits; `.log` is the motion."""
    return _heft.excite(_robot(robot), duration, harmonics, seed, rehearse, progress)


def simulate(scenario):
    """Runs a scenario (a dictionary, or the path of a file) on the simulated arm; `.log` is what its sensors saw."""
    if isinstance(scenario, dict):
        return _heft.simulate(_json.dumps(scenario), ".")
    path = _pathlib.Path(scenario)
    return _heft.simulate(path.read_text(), str(path.parent))


def stiffness(robot, measurements):
    """Joint stiffness from files of loads and deflections."""
    files = measurements if isinstance(measurements, (list, tuple)) else [measurements]
    return _heft.stiffness(_robot(robot), [str(file) for file in files])


class LiveLoad:
    """The load of an arm, sample by sample, as a controller follows it.

    >>> live = heft.LiveLoad("ur5e", baseline="empty.csv")
    >>> event = live.push(time, q, tau)     # a dictionary when something happened, else None
    """

    def __init__(self, robot, *, baseline=None, torque_at="motor", first_joint=1):
        self._live = _heft.LiveLoad(_robot(robot), _logs(baseline), torque_at, first_joint)

    def push(self, time, q, tau, qd=()):
        event = self._live.push(time, q, tau, qd)
        return _json.loads(event) if event else None

    def end(self):
        return _json.loads(self._live.end())
