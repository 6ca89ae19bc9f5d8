/** The cameras of the scene: their frustums in the user's view, and the lamp at the endoscope. */

import * as THREE from "three";
import type { Session } from "../wire/session.ts";
import { SceneCamera } from "./camera.ts";
import { LAYER_OUTSIDE, type World } from "./world.ts";

/** Depth of a drawn frustum (m): the endoscope's reaches the organs, others are marks. */
const ENDOSCOPE_DEPTH_M = 0.05;
const OTHER_DEPTH_M = 0.08;

export class Cameras {
  readonly list: SceneCamera[] = [];
  private readonly group = new THREE.Group();
  private readonly lamp = new THREE.SpotLight(0xfffaf2, 0, 0.6, 1.1, 0.6, 2);
  private readonly line = new THREE.LineBasicMaterial({ color: 0x0b9a92, transparent: true, opacity: 0.8 });

  constructor(private readonly world: World, session: Session) {
    world.scene.add(this.group, this.lamp.target);
    world.addLamp(this.lamp, 0, 0.03);
    this.group.visible = false;
    session.on("scene", (scene) => {
      for (const child of this.group.children) (child as THREE.LineSegments).geometry.dispose();
      this.group.clear();
      for (const camera of this.list) camera.dispose();
      this.list.length = 0;
      for (const model of scene.header.cameras) {
        const camera = new SceneCamera(model);
        this.list.push(camera);
        const frustum = camera.frustum(model.endoscope ? ENDOSCOPE_DEPTH_M : OTHER_DEPTH_M, this.line);
        frustum.layers.set(LAYER_OUTSIDE);
        this.group.add(frustum);
      }
      const endoscope = this.endoscope;
      if (!endoscope) return;
      this.lamp.position.copy(endoscope.camera.position);
      this.lamp.target.position.set(0, 0, -0.1).applyMatrix4(endoscope.camera.matrixWorld);
    });
  }

  get endoscope(): SceneCamera | undefined {
    return this.list.find((camera) => camera.model.endoscope) ?? this.list[0];
  }

  named(name: string): SceneCamera | undefined {
    return this.list.find((camera) => camera.model.name === name);
  }

  showFrustums(on: boolean): void {
    this.group.visible = on;
    this.world.draw();
  }
}
