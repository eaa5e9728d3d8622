// Histograms of before and after on one axis.

import { FixedScaleAxis, Interpolation, LineChart } from 'chartist';

// Corners of the steps: each bin's count from its left end on; the last ends on the axis.
function steps(histogram, counts) {
  const width = (histogram.high - histogram.low) / counts.length;
  const points = counts.map((count, i) => ({ x: histogram.low + i * width, y: count }));
  points.push({ x: histogram.high, y: counts.at(-1) });
  return points;
}

function ticks(low, high, most, steps) {
  const step = steps.find((s) => (high - low) / s <= most) ?? 10;
  const values = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9; i += 1) values.push(i * step);
  return values;
}

function drawHistogram(id, histogram, axisTitle, tickSteps, label) {
  const element = document.getElementById(id);
  if (!element) return null;  // nothing to count
  const most = element.clientWidth < 420 ? 6 : 11;
  const series = ['before', 'after'].map((name) => ({
    name,
    className: `series-${name}`,
    data: steps(histogram, histogram[name]),
  }));
  const chart = new LineChart(element, { series }, {
    axisX: {
      type: FixedScaleAxis,
      low: histogram.low,
      high: histogram.high,
      ticks: ticks(histogram.low, histogram.high, most, tickSteps),
      labelInterpolationFnc: label,
      showGrid: false,
    },
    axisY: { onlyInteger: true, low: 0, scaleMinSpace: 34 },
    chartPadding: { top: 12, right: 18, bottom: 0, left: 14 },
    lineSmooth: Interpolation.step(),
    showArea: true,
    showPoint: false,
  });
  const caption = document.createElement('p');
  caption.className = 'chart-caption note';
  caption.innerHTML = '<span><i class="key-before"></i>before</span><span><i class="key-after"></i>after</span>';
  caption.append(axisTitle);
  element.after(caption);
  return chart;
}

// 1e-9 as 10 to the power of -9.
function powerOfTen(exponent) {
  const raised = String(exponent).replace(/./g, (c) => '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'['-0123456789'.indexOf(c)]);
  return `10${raised}`;
}

export function drawCharts(details) {
  drawHistogram('jacobian-chart', details.scaled_jacobian, 'elements by scaled Jacobian', [0.1, 0.2, 0.5],
    (value) => String(Math.round(value * 100) / 100));
  drawHistogram('deviation-chart', details.deviation, 'nodes by millimetres', [1, 2, 5],
    (value) => powerOfTen(Math.round(value)));
}
