/** Conditions of stages with the numbers of their gates. */

/** A stage's condition with the values of the gates that it names. */
export function withThresholds(when: string, gates: { name: string; value: number }[]): string {
  const value = new Map(gates.map((gate) => [gate.name, gate.value]));
  return when.replace(/gates\.\w+/g, (name) => {
    const known = value.get(name);
    if (known === undefined) return name;
    const unit = name.endsWith("_mm") ? " mm" : name.endsWith("_s") ? " s" : name.endsWith("_n") ? " N" : "";
    return `${known}${unit}`;
  });
}
