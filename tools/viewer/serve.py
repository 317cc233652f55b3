"""Serves the page of `tessera view`, and a folder of tiles below it, to this machine alone.

  serve.py PAGE_DESCRIPTOR PORT [FOLDER]

The page is read from an open descriptor; PORT 0 takes a free one. Prints the address. SIGINT and SIGTERM end it.
"""
import http.server
import os
import posixpath
import signal
import socketserver
import sys
import urllib.parse

TYPES = {
    ".json": "application/json", ".glb": "model/gltf-binary", ".gltf": "model/gltf+json", ".bin": "application/octet-stream",
    ".b3dm": "application/octet-stream", ".i3dm": "application/octet-stream", ".pnts": "application/octet-stream",
    ".cmpt": "application/octet-stream", ".subtree": "application/octet-stream", ".png": "image/png", ".jpg": "image/jpeg",
    ".jpeg": "image/jpeg", ".webp": "image/webp", ".ktx2": "image/ktx2",
}


class Handler(http.server.BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    server_version = "tessera-view"
    sys_version = ""
    timeout = 60  # of a connection that says nothing

    def do_GET(self):
        # Another site's page may point a name of its own at this address: it gets nothing.
        if self.headers.get("Host", "") not in self.server.hosts:
            return self.refuse(403)
        path = urllib.parse.unquote(self.path.split("?", 1)[0].split("#", 1)[0])
        if path == "/":
            return self.give(self.server.page, "text/html; charset=utf-8")
        place = self.place(path)
        if place is None:
            return self.refuse(404)
        try:
            file = os.open(place, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW)
        except OSError:
            return self.refuse(404)
        try:
            self.give(file, TYPES[os.path.splitext(place)[1].lower()])
        finally:
            os.close(file)

    do_HEAD = do_GET

    def place(self, path):
        """The file of a path, if it is one of tiles and lies within the folder, links resolved."""
        if self.server.folder is None or not path.startswith("/site/") or "\0" in path:
            return None
        name = path[len("/site/"):]
        if posixpath.splitext(name)[1].lower() not in TYPES:
            return None
        place = os.path.realpath(os.path.join(self.server.folder, name.lstrip("/")))
        inside = place.startswith(os.path.join(self.server.folder, ""))
        return place if inside and os.path.isfile(place) else None

    def give(self, file, kind):
        size = os.fstat(file).st_size
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(size))
        self.send_header("Cache-Control", "no-cache")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("Cross-Origin-Resource-Policy", "same-origin")
        self.end_headers()
        self.wfile.flush()
        at = 0
        while self.command != "HEAD" and at < size:
            sent = os.sendfile(self.connection.fileno(), file, at, size - at)
            if sent == 0:  # the file was cut meanwhile
                self.close_connection = True
                return
            at += sent

    def refuse(self, code):
        self.send_response(code)
        self.send_header("Content-Length", "0")
        self.end_headers()

    def log_message(self, *_):
        pass

    def handle(self):
        try:
            super().handle()
        except (ConnectionError, TimeoutError):
            pass  # a page that was closed


class Server(socketserver.ThreadingMixIn, http.server.HTTPServer):
    daemon_threads = True
    block_on_close = False
    request_queue_size = 64

    def server_bind(self):  # without the look-up of this machine's name
        socketserver.TCPServer.server_bind(self)
        self.server_name, self.server_port = self.server_address[:2]


def main():
    page, port = int(sys.argv[1]), int(sys.argv[2])
    try:
        server = Server(("127.0.0.1", port), Handler)
    except OSError as error:
        print(f"tessera: error: --port {port}: {os.strerror(error.errno).lower()}: name another one, or none", file=sys.stderr)
        sys.exit(2)
    server.page = page
    server.folder = os.path.realpath(sys.argv[3]) if len(sys.argv) > 3 else None
    server.hosts = {f"{name}:{server.server_port}" for name in ("127.0.0.1", "localhost")}
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: os._exit(0))  # nothing is written, so nothing is lost
    signal.pthread_sigmask(signal.SIG_SETMASK, [])
    print(f"http://127.0.0.1:{server.server_port}/", flush=True)
    print("tessera: serving to this machine alone; Ctrl-C ends it", file=sys.stderr, flush=True)
    server.serve_forever()


main()
