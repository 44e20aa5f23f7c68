// Rows of lists.

/** Returns the rows of a list of terms and their values. */
export function rows(pairs) {
  return pairs.flatMap(([name, value]) => {
    const [dt, dd] = [document.createElement("dt"), document.createElement("dd")];
    [dt.textContent, dd.textContent] = [name, value];
    return [dt, dd];
  });
}
