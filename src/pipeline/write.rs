//! The end of a render: everything that is asked for is written.

use std::time::Instant;

use super::prepare::Prepared;
use super::run::Rendered;
use crate::error::Result;
use crate::output::mattes::{self, MOST_SAMPLES};

impl Prepared<'_> {
    /// Writes everything but what [`Prepared::run`] has saved on the way. The error is the first of both; the image comes first, and if
    /// it cannot be written anywhere, it goes to the folder for temporary files.
    pub fn write(&self, rendered: &mut Rendered) -> Result<()> {
        let Rendered { frame, solution, stats, .. } = rendered;
        if let Some(solution) = solution {
            self.outputs.write_image(&self.method, (frame, solution), self.scene.sensor().inner(), stats)?;
        }
        std::mem::replace(&mut rendered.stored, Ok(()))?;
        let stats = &mut rendered.stats;
        if let Some(path) = &self.outputs.cryptomatte {
            let start = Instant::now();
            let mattes = mattes::mattes(self.scene, self.settings.seed, stats.spp.clamp(1, MOST_SAMPLES));
            mattes::save(path, self.scene.sensor(), &mattes, rendered.frame.provenance.attributes())?;
            stats.seconds.write += start.elapsed().as_secs_f64();
        }
        Ok(())
    }
}
