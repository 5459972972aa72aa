// A panel in a frame of another page: it sends its height to that page, and follows the theme of that page.
if (parent !== window) {
  document.documentElement.classList.add("framed");
  new ResizeObserver(() => {
    parent.postMessage({ phigenPanel: document.documentElement.getBoundingClientRect().height }, "*");
  }).observe(document.body);
  addEventListener("message", ({ data }) => {
    if (!["light", "dark"].includes(data?.phigenTheme)) return;
    document.documentElement.dataset.theme = data.phigenTheme;
    document.documentElement.dispatchEvent(new Event("themechange"));
  });
}
