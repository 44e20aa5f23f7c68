// Saves what is shown: pictures, clouds, arrays, and a link to the same view.

/** Time that a browser has to save a file. */
const KEPT_MS = 60_000;

const $ = (id) => document.getElementById(id);

/** Downloads a canvas as PNG. */
export function savePicture(canvas, name) {
  canvas.toBlob((blob) => save(blob, `${name}.png`));
}

/** Downloads a text. */
export function saveText(text, name) {
  save(new Blob([text], { type: "text/plain" }), name);
}

function save(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), KEPT_MS);
}

/** Lets the links save the last scan of a scanner. */
export function offerFiles(source, token, measurement) {
  for (const [id, name, there] of [["save-cloud", "cloud.ply", measurement?.cloud], ["save-arrays", "scan.npz", measurement]]) {
    $(id).hidden = !there;
    $(id).href = `/scans/${source}/${name}?token=${token}`;
  }
  $("save-picture").hidden = !measurement;
}

/** Copies the address of the view that is shown, for others to watch. */
export async function copyLink(source, token) {
  const hash = new URLSearchParams(location.hash.slice(1));
  hash.set("scanner", source);
  const link = `${location.origin}/?token=${token}#${hash}`;
  const button = $("link");
  const text = button.textContent;
  // Some browsers keep the clipboard from pages.
  await navigator.clipboard.writeText(link).then(() => { button.textContent = "Copied"; }, () => prompt("Link", link));
  setTimeout(() => { button.textContent = text; }, 1500);
}
