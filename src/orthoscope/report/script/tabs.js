/* Tabs and copy buttons. */
document.querySelectorAll("[role=tablist]").forEach(list => {
  const tabs = [...list.querySelectorAll("[role=tab]")];
  const choose = tab =>
    tabs.forEach(each => {
      const mine = each === tab;
      each.setAttribute("aria-selected", `${mine}`);
      each.tabIndex = mine ? 0 : -1;
      document.getElementById(each.getAttribute("aria-controls")).hidden = !mine;
    });
  tabs.forEach((tab, i) => {
    tab.addEventListener("click", () => choose(tab));
    tab.addEventListener("keydown", e => {
      const by = { ArrowRight: 1, ArrowLeft: -1 }[e.key];
      if (by) {
        const next = tabs[(i + by + tabs.length) % tabs.length];
        choose(next);
        next.focus();
      }
    });
  });
});
async function copied(text) {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    /* no clipboard for files in this browser */
  }
  const area = Object.assign(document.createElement("textarea"), { value: text, className: "voice" });
  document.body.append(area);
  area.select();
  const done = document.execCommand("copy");
  area.remove();
  return done;
}
document.querySelectorAll("button.copy").forEach(button =>
  button.addEventListener("click", async () => {
    const from = button.closest(".camera, #left-out"),
      text = (from.querySelector("[role=tabpanel]:not([hidden]) code") || from.querySelector("code"))
        .textContent;
    const words = (await copied(text)) ? "Copied" : "Select and copy";
    button.textContent = words;
    say(words);
    setTimeout(() => {
      button.textContent = "Copy";
    }, 1600);
  }),
);
