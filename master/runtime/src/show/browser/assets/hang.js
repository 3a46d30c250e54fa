// Luminaires' files: dropped on the picture or the panel, or chosen by a button. The master reads them.

/** As much as the master takes of one. */
const BYTES_MAX = 1 << 20;
const ENDINGS = /\.(ies|ldt|eul)$/i;

/** `on`: may(), refused(), lampAt(x, y), chosen(), spot(x, y), hint(text or null), toast(text), say(word, rest). */
export function takeFiles(stage, button, input, on) {
  const hasFile = (e) => [...(e.dataTransfer?.types ?? [])].includes("Files");
  const overPicture = (e) => stage.contains(e.target);
  /** Which lamps get it; none: a new one is hung where it is dropped. */
  const meant = (e) => {
    const lamp = e && overPicture(e) && on.lampAt(e.clientX, e.clientY, "mouse");
    return lamp ? [lamp.index] : on.chosen();
  };
  const words = (lights) => (lights.length === 0 ? "hangs a new lamp here" : lights.length === 1 ? `for ${on.name(lights[0])}` : `for ${lights.length} lamps`);

  // Else the browser shows the file instead of the page.
  addEventListener("dragover", (e) => {
    if (!hasFile(e)) return;
    e.preventDefault();
    e.dataTransfer.dropEffect = on.may() ? "copy" : "none";
    on.hint(on.may() ? `Luminaire's file: ${words(meant(e))}` : null);
  });
  addEventListener("dragleave", (e) => { if (!e.relatedTarget) on.hint(null); });
  addEventListener("drop", (e) => {
    on.hint(null);
    if (!hasFile(e)) return;
    e.preventDefault();
    send(e.dataTransfer.files, meant(e), overPicture(e) ? on.spot(e.clientX, e.clientY) : MIDDLE);
  });
  button.onclick = () => (on.may() ? input.click() : on.refused());
  input.onchange = () => { send(input.files, meant(null), MIDDLE); input.value = ""; };

  function send(files, lights, at) {
    if (!on.may()) return on.refused();
    const file = files[0];
    if (!file) return;
    if (files.length > 1) return on.toast("One luminaire's file at a time.");
    if (!ENDINGS.test(file.name)) return on.toast(`${file.name}: a luminaire's file ends in .ies or .ldt.`);
    if (file.size > BYTES_MAX) return on.toast(`${file.name}: is too large for a luminaire's file.`);
    const reader = new FileReader();
    reader.onerror = () => on.toast(`${file.name}: cannot be read.`);
    reader.onload = () => on.say("hang", { file: file.name, data: reader.result.slice(reader.result.indexOf(",") + 1), lights, at });
    reader.readAsDataURL(file);
  }
}
const MIDDLE = { x: 0.5, y: 0.5 };
