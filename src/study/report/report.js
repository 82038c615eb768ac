(() => {
"use strict";
const all = (selector) => document.querySelectorAll(selector);

// One choice for the whole page, so that scenes can be compared.
const chosen = {};
for (const control of all("[data-choose]")) {
  if (control.type !== "radio" || control.checked) chosen[control.dataset.choose] ??= control.value;
}
const show = () => {
  for (const element of all("[data-metric]")) {
    const { metric, axis } = element.dataset;
    element.hidden = metric !== chosen.metric || (axis !== undefined && axis !== chosen.axis);
  }
  for (const control of all("[data-choose]")) {
    const value = chosen[control.dataset.choose];
    if (control.type === "radio") control.checked = control.value === value;
    else control.value = value;
  }
};
for (const control of all("[data-choose]")) {
  control.addEventListener("change", () => {
    // What the reader looks at stays where it is while scenes above change their height.
    const before = control.getBoundingClientRect().top;
    chosen[control.dataset.choose] = control.value;
    show();
    scrollBy({ top: control.getBoundingClientRect().top - before, behavior: "instant" });
  });
}
if (all("[data-choose]").length > 0) show();

for (const button of all("[data-series-of]")) {
  button.addEventListener("click", () => {
    const on = button.getAttribute("aria-pressed") !== "true";
    button.setAttribute("aria-pressed", String(on));
    const scene = button.closest("section");
    for (const part of scene.querySelectorAll("[data-series], [data-band]")) {
      const name = part.dataset.series ?? part.dataset.band;
      if (name === button.dataset.seriesOf) part.style.display = on ? "" : "none";
    }
  });
}

const theme = document.getElementById("theme");
const themes = ["system", "light", "dark"];
// A browser may refuse storage to files from disk; the switch works without.
const stored = () => { try { return localStorage.getItem("isophote-theme"); } catch { return null; } };
const store = (value) => { try { localStorage.setItem("isophote-theme", value); } catch { /* kept for this page only */ } };
const apply = (value) => {
  if (value === "system") delete document.documentElement.dataset.theme;
  else document.documentElement.dataset.theme = value;
  theme.querySelector("span").textContent = value;
};
let current = themes.includes(stored()) ? stored() : "system";
apply(current);
theme.hidden = false;
theme.addEventListener("click", () => {
  current = themes[(themes.indexOf(current) + 1) % themes.length];
  apply(current);
  store(current);
});
})();
