"""A page in headless Chromium, served by this process, and what it posts to /result."""

import http.server
import json
import shutil
import subprocess
import tempfile
import threading
from pathlib import Path

SECONDS = 120


def result_of(page, files, job=None, picture=None):
    """Opens ``page`` of ``files`` (contents or paths by their names; folders too) and returns the
    JSON that it posts to /result. ``job`` is served as /job. ``picture`` is a screenshot to write."""
    chromium = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    assert chromium, "missing: Chromium (Debian: apt install chromium)"
    posted, done = [], threading.Event()

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            name = self.path.partition("?")[0].lstrip("/")
            content = json.dumps(job).encode() if name == "job" else files.get(name)
            if content is None:
                folder = next((files[top] for top in files if name.startswith(f"{top}/")), None)
                path = folder and Path(folder, name.partition("/")[2])
                content = path if path and path.is_file() else None
            if isinstance(content, Path):
                content = content.read_bytes()
            self.send_response(200 if content is not None else 404)
            kinds = {".html": "text/html", ".js": "text/javascript", ".json": "application/json"}
            self.send_header("Content-Type", kinds.get(Path(name).suffix, "application/octet-stream"))
            self.end_headers()
            self.wfile.write(content or b"")

        def do_POST(self):
            posted.append(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
            self.send_response(200)
            self.end_headers()
            done.set()

        def log_message(self, *_):
            pass

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    with tempfile.TemporaryDirectory() as home:
        command = [
            chromium,
            "--headless",
            "--no-sandbox",
            "--disable-dev-shm-usage",
            f"--user-data-dir={home}",
            "--use-angle=swiftshader",
            "--enable-unsafe-swiftshader",
            "--enable-unsafe-webgpu",
            "--enable-features=Vulkan",
            "--use-webgpu-adapter=swiftshader",
            "--window-size=960,400",
            "--remote-debugging-port=0",
            f"http://127.0.0.1:{server.server_port}/{page}",
        ]
        log = Path(home, "log")
        with log.open("w") as errors:
            process = subprocess.Popen(command, stdout=errors, stderr=errors)
            try:
                assert done.wait(SECONDS), f"{page} posted nothing:\n{log.read_text()[-3000:]}"
            finally:
                process.terminate()
                process.wait()
                server.shutdown()
                server.server_close()
    return posted[0]
