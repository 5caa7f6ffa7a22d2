//! Recurrent cells: LSTM over vectors and over planes, and the gates that both share.

mod conv_lstm;
mod gates;
mod lstm;

pub use conv_lstm::{PlanarConvLstm, PlanarConvLstmState};
pub use gates::{Squash, lstm_update, lstm_update_rows};
pub use lstm::{Lstm, LstmParts, LstmState};
