import type { Vec3 } from '../messages.ts';
import { figure } from '../parts/format.ts';
import type { Ray } from '../state/rays.ts';

// What the ray under the cursor meets, in figures.
export function RayReadout({ ray }: { ray: Ray }) {
  const { mirrored } = ray;
  return (
    <dl class="readout glass" data-testid="ray-readout">
      <Entry name="Depth" value={ray.depth} />
      <Entry name="Tint" value={ray.tint} />
      <Entry name="Alpha" value={ray.alpha} />
      <Entry
        name="Mirrored"
        value={mirrored ? (mirrored.distance > 0 ? mirrored.distance : 'meets nothing') : undefined}
      />
      <Colour name="Colour" value={ray.colour} />
      <Colour name="Diffuse" value={ray.diffuse} />
      <Colour name="Specular" value={ray.specular} />
    </dl>
  );
}

function Entry({ name, value }: { name: string; value: number | string | undefined }) {
  if (value === undefined) return null;
  return (
    <div>
      <dt>{name}</dt>
      <dd>{typeof value === 'number' ? figure(value) : value}</dd>
    </div>
  );
}

function Colour({ name, value }: { name: string; value: Vec3 | undefined }) {
  if (!value) return null;
  const [r, g, b] = value.map((c) => Math.round(Math.min(Math.max(c, 0), 1) * 255));
  return (
    <div>
      <dt>{name}</dt>
      <dd>
        <i class="swatch" style={{ background: `rgb(${r}, ${g}, ${b})` }} />
        {value.map((c) => c.toFixed(2)).join(' ')}
      </dd>
    </div>
  );
}
