//! Bytes back from the device.

use std::sync::mpsc;
use std::time::Duration;

use crate::context::Context;
use crate::error::{Error, Result};

const WHAT: &str = "reading back";

/// How long the answer may take after the device is done.
const PATIENCE: Duration = Duration::from_secs(10);

impl Context {
    /// The contents of a buffer with the usage `COPY_SRC`. Waits for the device.
    ///
    /// # Errors
    /// Those of [`Context::guard`].
    pub fn read_buffer(&self, buffer: &wgpu::Buffer) -> Result<Vec<u8>> {
        let size = buffer.size();
        self.read_back(size, |encoder, staging| encoder.copy_buffer_to_buffer(buffer, 0, staging, 0, size))
    }

    /// The texels of a 2-D or 3-D texture with the usage `COPY_SRC`, without padding: the column is the
    /// fastest index, then the row, then the layer. `T` has the size of a texel. Waits for the device.
    pub(crate) fn read_texture<T: bytemuck::Pod>(&self, texture: &wgpu::Texture) -> Result<Vec<T>> {
        let line = texture.width() as usize * size_of::<T>();
        let row = line.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT as usize);
        let too_long = || Error::Limit {
            what: "row of a picture",
            expected: "under 4 GiB".to_owned(),
            found: format!("{row} bytes"),
        };
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(u32::try_from(row).map_err(|_| too_long())?),
            rows_per_image: Some(texture.height()),
        };
        let rows = u64::from(texture.height()) * u64::from(texture.depth_or_array_layers());
        let bytes = self.read_back(row as u64 * rows, |encoder, buffer| {
            let target = wgpu::TexelCopyBufferInfo { buffer, layout };
            encoder.copy_texture_to_buffer(texture.as_image_copy(), target, texture.size());
        })?;
        let mut texels = vec![T::zeroed(); bytes.len() / row * texture.width() as usize];
        for (to, from) in
            bytemuck::cast_slice_mut(&mut texels).chunks_exact_mut(line).zip(bytes.chunks_exact(row))
        {
            to.copy_from_slice(&from[..line]);
        }
        Ok(texels)
    }

    /// Records a copy to a buffer of `size` bytes, submits it and waits for the bytes.
    fn read_back(
        &self,
        size: u64,
        copy: impl FnOnce(&mut wgpu::CommandEncoder, &wgpu::Buffer),
    ) -> Result<Vec<u8>> {
        let usage = wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ;
        let staging = self.empty_buffer("read-back buffer", size, usage)?;
        let (answered, answer) = mpsc::sync_channel(1);
        self.guard(WHAT, || {
            let mut encoder =
                self.device().create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            copy(&mut encoder, &staging);
            self.queue().submit([encoder.finish()]);
            staging.map_async(wgpu::MapMode::Read, .., move |result| {
                let _nobody_waits = answered.send(result);
            });
        })?;
        self.wait(WHAT)?;
        let failed = |message: String| Error::Gpu { what: WHAT.to_owned(), message };
        // Another thread that waits for the device may have to hand over the answer, which it does after its own wait.
        match answer.recv_timeout(PATIENCE) {
            Ok(Ok(())) => {}
            Ok(Err(error)) => return Err(failed(error.to_string())),
            Err(_) => return Err(failed("the device did not answer".to_owned())),
        }
        let bytes = staging.get_mapped_range(..).map_err(|error| failed(error.to_string()))?.to_vec();
        staging.unmap();
        Ok(bytes)
    }
}
