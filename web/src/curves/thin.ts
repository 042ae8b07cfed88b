// Indices of at most about `limit` of the values, in order: the least and the greatest of each run of neighbours, so
// that the drawn line has the shape of the whole; the ends are always among them.
export function thinned(values: readonly (number | null)[], limit: number): number[] {
  const count = values.length;
  if (count <= limit) return values.map((_, i) => i);
  const runs = Math.max(1, Math.floor((limit - 2) / 2));
  const kept = new Set([0, count - 1]);
  for (let run = 0; run < runs; run++) {
    const first = Math.floor((run * count) / runs);
    const last = Math.floor(((run + 1) * count) / runs);
    let [least, greatest] = [first, first];
    for (let i = first; i < last; i++) {
      if ((values[i] ?? Infinity) < (values[least] ?? Infinity)) least = i;
      if ((values[i] ?? -Infinity) > (values[greatest] ?? -Infinity)) greatest = i;
    }
    kept.add(least).add(greatest);
  }
  return [...kept].sort((a, b) => a - b);
}
