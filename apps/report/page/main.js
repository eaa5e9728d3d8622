// The report page's script: charts, the 3D view, saving the figures.

import { drawCharts } from './charts.js';
import { startViewer } from './viewer.js';

const data = JSON.parse(document.getElementById('data').textContent);

function saveFigures() {
  const file = new Blob([JSON.stringify(data.report, null, 2)], { type: 'application/json' });
  const link = document.createElement('a');
  link.href = URL.createObjectURL(file);
  link.download = 'cadmorph-report.json';
  link.click();
  URL.revokeObjectURL(link.href);
}

document.getElementById('download-json').addEventListener('click', saveFigures);
drawCharts(data.details);
startViewer(data.surface, data.details.worst);
