// The panels of the gallery: each is a page of its own, which is loaded when it is opened, and goes when it is closed.
{
  const theme = () => (document.body.dataset.mdColorScheme === "slate" ? "dark" : "light");
  const frames = () => [...document.querySelectorAll("details[data-live] iframe")];
  const tell = (frame) => frame.contentWindow.postMessage({ phigenTheme: theme() }, "*");

  for (const details of document.querySelectorAll("details[data-live]")) {
    details.addEventListener("toggle", () => {
      details.querySelector("iframe")?.remove();
      if (!details.open) return;
      const frame = document.createElement("iframe");
      frame.title = details.querySelector("summary").textContent;
      frame.src = details.dataset.live;
      frame.addEventListener("load", () => tell(frame));
      details.append(frame);
    });
  }
  addEventListener("message", ({ source, data }) => {
    const frame = frames().find(({ contentWindow }) => contentWindow === source);
    if (frame && data?.phigenPanel > 0) frame.style.height = `${Math.ceil(data.phigenPanel)}px`;
  });
  new MutationObserver(() => frames().forEach(tell)).observe(document.body, { attributeFilter: ["data-md-color-scheme"] });
}
