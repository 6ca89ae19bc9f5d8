/** The page of this clone on one port, with the wire of a running program behind it, as through a tunnel. */

import { createServer } from "node:http";
import { connect } from "node:net";
import { readFile } from "node:fs/promises";
import { extname, join } from "node:path";

export const TYPES: Record<string, string> = { ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml" };

/** Opens the tunnel to the program at `address`; the page's own address, and what closes it. */
export async function tunnel(address: string, dist: string): Promise<{ address: string; close: () => void }> {
  const to = new URL(address);
  const server = createServer((request, response) => {
    const path = new URL(request.url ?? "/", address).pathname;
    const name = path === "/" ? "index.html" : path.slice(1);
    void readFile(join(dist, name)).then(
      (body) => response.writeHead(200, { "content-type": TYPES[extname(name)] ?? "application/octet-stream" }).end(body),
      () => response.writeHead(404).end(),
    );
  });
  server.on("upgrade", (request, socket, head) => {
    const through = connect(Number(to.port), to.hostname, () => {
      const lines = request.rawHeaders.flatMap((text, i) => (i % 2 === 0 ? [`${text}: ${request.rawHeaders[i + 1]}`] : []));
      through.write(`${request.method} ${request.url} HTTP/1.1\r\n${lines.join("\r\n")}\r\n\r\n`);
      through.write(head);
      socket.pipe(through).pipe(socket);
    });
    for (const end of [socket, through]) end.on("error", () => end.destroy());
    socket.on("close", () => through.destroy());
    through.on("close", () => socket.destroy());
  });
  await new Promise<void>((done) => server.listen(0, "127.0.0.1", done));
  const place = server.address();
  const port = typeof place === "object" && place ? place.port : 0;
  const close = (): void => {
    server.closeAllConnections();
    server.close();
  };
  return { address: `http://127.0.0.1:${port}/${to.search}`, close };
}
