/** What the keys, the mouse and the gamepad's parts do. */

type Row = [keys: string[], text: string];

const RECORD: Row[] = [
  [["Enter"], "Keep the demonstration"],
  [["Delete"], "Discard it"],
  [["Backspace"], "The same seed again"],
];

const KEYS: Record<string, Row[]> = {
  keyboard: [
    [["Space"], "Clutch: hold to move"],
    [["A", "D"], "Left, right"],
    [["S", "W"], "Down, up"],
    [["Q", "E"], "Back, deeper"],
    [["J", "L"], "Roll"],
    [["K", "I"], "Close, open the jaw"],
    [["1", "2"], "Left arm, right arm"],
    [["H"], "Hand back to the policy"],
    ...RECORD,
  ],
  mouse: [
    [["Drag"], "Moves the tip under the pointer"],
    [["Wheel"], "Inserts while you drag"],
    [["H"], "Hand back to the policy"],
    ...RECORD,
  ],
  gamepad: [
    [["LB", "RB"], "Clutch of the left, the right arm"],
    [["Stick"], "Sideways and height"],
    [["▲", "▼"], "Left arm deeper, back"],
    [["Y", "A"], "Right arm deeper, back"],
    [["◀", "▶"], "Left arm roll"],
    [["X", "B"], "Right arm roll"],
    [["LT", "RT"], "Close the jaw"],
    [["L3"], "Hand back to the policy"],
    [["Start"], "Keep the demonstration"],
    [["Back"], "Discard it"],
    [["R3"], "The same seed again"],
  ],
};

export function keysOf(device: string): Row[] {
  return KEYS[device] ?? [];
}
