/** The light that surfaces reflect: a dark room with soft boxes, which makes wet tissue look wet. */

import * as THREE from "three";

/** The room as an environment map. */
export function studio(renderer: THREE.WebGLRenderer): THREE.Texture {
  const room = new THREE.Scene();
  const wall = new THREE.Mesh(
    new THREE.BoxGeometry(10, 10, 10),
    new THREE.MeshBasicMaterial({ color: 0x6d747a, side: THREE.BackSide }),
  );
  room.add(wall);
  const lamp = (x: number, y: number, z: number, width: number, height: number, power: number): void => {
    const material = new THREE.MeshBasicMaterial({ color: new THREE.Color(power, power, power) });
    const box = new THREE.Mesh(new THREE.PlaneGeometry(width, height), material);
    box.position.set(x, y, z);
    box.lookAt(0, 0, 0);
    room.add(box);
  };
  lamp(1.5, -2, 4.6, 2.2, 1.2, 14);
  lamp(-3.2, 2.5, 3.6, 1.6, 1.6, 6);
  lamp(4, 3, 1.2, 0.8, 3, 4);
  const floor = new THREE.Mesh(new THREE.PlaneGeometry(9, 9), new THREE.MeshBasicMaterial({ color: 0x2c2a29 }));
  floor.position.z = -3;
  room.add(floor);
  const generator = new THREE.PMREMGenerator(renderer);
  const target = generator.fromScene(room, 0.03, 0.1, 20);
  generator.dispose();
  room.traverse((object) => {
    if (!(object instanceof THREE.Mesh)) return;
    object.geometry.dispose();
    (object.material as THREE.Material).dispose();
  });
  return target.texture;
}
