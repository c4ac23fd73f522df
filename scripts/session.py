"""A ROS master and the processes around it, which end with the block. For the scripts beside it."""
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import sys
import time
import xmlrpc.client

ROOT = pathlib.Path(__file__).resolve().parent.parent
SCENE = ROOT / "build/data/milk_cartoon_all_small_clorox.pcd"
TABLETOP = ROOT / "build/devel/lib/tabletop_perception/tabletop"


def prepare(out):
    """An empty folder `out` with objects.db, which knows the milk carton of SCENE."""
    if not TABLETOP.exists():
        sys.exit(f"{pathlib.Path(sys.argv[0]).name}: build first: scripts/build")
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    subprocess.run([ROOT / "scripts/fetch_clouds", ROOT / "build/data"], check=True, stdout=subprocess.DEVNULL)
    subprocess.run([TABLETOP, "train", "--database", out / "objects.db", "--name", "milk", "--cloud",
                    ROOT / "build/data/milk.pcd"], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def free_port():
    with socket.socket() as free:
        free.bind(("", 0))
        return free.getsockname()[1]


def wait_for(condition, seconds, what):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if condition():
            return
        time.sleep(0.05)
    raise RuntimeError(f"{what} within {seconds:g} s")


class Session:
    """`name` is that of its logs in `out`."""

    def __init__(self, out, name, uri=None):
        self.out = out
        self.name = name
        self.processes = []
        uri = uri or f"http://localhost:{free_port()}"
        text = subprocess.run(["bash", "-c", f". {ROOT}/build/devel/setup.bash && env -0"], check=True,
                              capture_output=True, text=True,
                              env={**os.environ, "PATH": "/usr/bin:" + os.environ["PATH"]}).stdout
        self.env = dict(line.split("=", 1) for line in text.split("\0") if line)
        for variable in ("ROS_IP", "ROS_HOSTNAME", "ROS_NAMESPACE"):
            self.env.pop(variable, None)
        self.env.update(ROS_MASTER_URI=uri, ROS_HOME=str(out / "ros"), PYTHONUNBUFFERED="1")
        self.master = xmlrpc.client.ServerProxy(uri)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for process in reversed(self.processes[:]):
            self.end(process)

    def start(self, log, *command, read=False, env=None):
        """With `read` the caller takes what it prints."""
        with open(self.out / f"{self.name}_{log}.log", "a") as file:
            process = subprocess.Popen(command, env={**self.env, **(env or {"ROS_HOSTNAME": "localhost"})},
                                       stdin=subprocess.DEVNULL, start_new_session=True, text=True,
                                       stdout=subprocess.PIPE if read else file, stderr=file)
        self.processes.append(process)
        return process

    def end(self, process):
        """Asks first; what does not go within 10 s is killed, with its whole process group."""
        if process.poll() is None:
            process.terminate()
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                pass
        try:
            os.killpg(process.pid, signal.SIGKILL)
        except ProcessLookupError:
            pass
        process.wait()
        self.processes.remove(process)
