// If the page of the panel is shown in a frame of another page: send the height of the panel to that page,
// and follow its theme.
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
