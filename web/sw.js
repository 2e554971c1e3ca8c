// The service worker of the page: after a first visit the page opens without a network.
//
// `offline.mjs` writes two constants above this text: FILES, each file of the page with its hash,
// and VERSION, the hash of all that and of this text. So the text changes when a file does, and
// the browser, which compares it at every visit, installs the new worker. A worker keeps all
// files of its version or none, asks no other host, and leaves all other addresses to the network.
const address = (name) => new URL(name, self.registration.scope).href;
// The caches of a host belong to all its pages.
const OWN = `splitsnow ${address("./")} `;
const CACHE = OWN + VERSION;

self.addEventListener("install", (event) => {
  const keep = async ([name, integrity], cache) => {
    // `no-cache`: the server says whether the file has changed. Another hash is an error.
    await cache.put(address(name), await fetch(address(name), { integrity, cache: "no-cache" }));
  };
  const install = async () => {
    const cache = await caches.open(CACHE);
    const files = Object.entries(FILES).map((file) => keep(file, cache));
    await Promise.all(files).catch(async (error) => {
      await caches.delete(CACHE);
      throw error;
    });
    // The next load of the page has the new files, also while it is open elsewhere.
    await self.skipWaiting();
  };
  event.waitUntil(install());
});

self.addEventListener("activate", (event) => {
  const activate = async () => {
    const old = (await caches.keys()).filter((name) => name.startsWith(OWN) && name !== CACHE);
    await Promise.all(old.map((name) => caches.delete(name)));
    await self.clients.claim();
  };
  event.waitUntil(activate());
});

self.addEventListener("fetch", (event) => {
  const { origin, pathname } = new URL(event.request.url);
  const asked = origin + pathname;
  const name = asked === address("index.html") ? address("./") : asked;
  if (event.request.method !== "GET" || !Object.keys(FILES).some((file) => address(file) === name)) return;
  const answer = async () => (await (await caches.open(CACHE)).match(name)) ?? fetch(event.request);
  event.respondWith(answer());
});
