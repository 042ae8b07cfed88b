import { useMemo } from 'preact/hooks';
import { Plot } from '../curves/Plot.tsx';
import { count } from '../parts/format.ts';
import type { MotionFigures, ReportData } from './data.ts';
import { charts_over_time, name_of } from './over_time.ts';

// Figures of views and of the motion against the capture's time.
export function OverTime({ data }: { data: ReportData }) {
  const charts = useMemo(() => charts_over_time(data), [data]);
  return (
    <>
      {charts.length > 0 && (
        <div class="curves">
          {charts.map((chart) => (
            <div key={chart.id} class={`curve curve-${chart.id}`}>
              <Plot chart={chart} phases={[]} height={170} />
            </div>
          ))}
        </div>
      )}
      {data.motion && <MotionTable motion={data.motion} />}
    </>
  );
}

const columns: { key: keyof MotionFigures; label: string; unit: string; digits: number }[] = [
  { key: 'moved', label: 'Moves', unit: 'capture units', digits: 3 },
  { key: 'missed', label: 'Missed by', unit: 'capture units', digits: 3 },
  { key: 'share', label: 'Motion error', unit: '', digits: 3 },
  { key: 'rotation_error_deg', label: 'Rotation error', unit: '°', digits: 1 },
  { key: 'scale', label: 'Scale', unit: '', digits: 3 },
  { key: 'true_scale', label: 'True scale', unit: '', digits: 3 },
];

function MotionTable({ motion }: { motion: NonNullable<ReportData['motion']> }) {
  const cells = (figures: MotionFigures) =>
    columns.map(({ key, digits }) => <td key={key}>{figures[key]?.toFixed(digits) ?? '–'}</td>);
  return (
    <>
      <div class="table-box motion" tabIndex={0} role="region" aria-label="Motion of each object">
        <table class="figures" data-testid="motion">
          <thead>
            <tr>
              <th scope="col">Motion of</th>
              <th scope="col">Points with surfels</th>
              {columns.map(({ key, label, unit }) => (
                <th key={key} scope="col">
                  {label}
                  {unit && <small> {unit}</small>}
                </th>
              ))}
            </tr>
          </thead>
          <tbody>
            {motion.objects.map((o) => (
              <tr key={o.object}>
                <th scope="row">{name_of(o)}</th>
                <td>
                  {count(o.followed_points)} of {count(o.points)}
                </td>
                {cells(o)}
              </tr>
            ))}
          </tbody>
          <tfoot>
            <tr>
              <th scope="row" colSpan={2}>
                Mean
              </th>
              {cells(motion.mean)}
            </tr>
          </tfoot>
        </table>
      </div>
      <p class="legend">
        Motion error: how far points of an object, carried by the surfels around them, end up from where they truly
        are, as a share of how far the object moves in the mean over time; 1 = not followed.
      </p>
    </>
  );
}
